#!/bin/sh
# Installs the foreign readers that the tests check the job folders with, below .venv in the root of the
# repository: Python packages (requirements.txt) and the G-code interpreter of Debian's linuxcnc-uspace,
# unpacked without root; with `all` also the packages that slow tests need (requirements-all.txt, Dask among them),
# Chromium with the packages that drive it and icons (../browser/package.json), the drawings of
# Debian's inkscape, Slurm, cargo-deny, and clean systems to install packages into: two of Debian, Wine, and an
# emulator of arm64. With `packages` only what builds the packages that users install, with `book` only what builds the book. Running it again costs nothing. Ends with an error if anything is missing.
set -eu

root=$(cd "$(dirname "$0")/../.." && pwd)
here="$root/tests/python"
venv="$root/.venv"
failed=0

complain() {
    printf '\n*** NOT INSTALLED: %s\n\n' "$1" >&2
    failed=1
}

# What is done, before it is done: some of it takes a minute.
tell() {
    printf 'setup: %s\n' "$1"
}

# --- Python packages
if ! python3 -c 'import ensurepip, venv' 2>/dev/null; then
    # Debian keeps these apart from python3 itself.
    install='apt-get install -y --no-install-recommends python3 python3-venv'
    tell "installing python3-venv, which needs root: $install"
    if [ "$(id -u)" = 0 ]; then
        { apt-get update && $install; } >/dev/null 2>&1 || complain "python3-venv ($install)"
    elif command -v sudo >/dev/null; then
        { sudo -n apt-get update && sudo -n $install; } >/dev/null 2>&1 || complain "python3-venv (sudo $install)"
    else
        complain "python3-venv ($install)"
    fi
fi
lists="$here/requirements.txt"
case "${1:-}" in
    book) lists= ;;
    all) lists="$lists $here/requirements-all.txt $here/requirements-packages.txt" ;;
    packages) lists="$here/requirements-packages.txt" ;;
esac
for list in $lists; do
    stamp="$venv/$(basename "$list" .txt).stamp"
    if ! cmp -s "$list" "$stamp"; then
        tell "installing the Python packages of ${list#"$root"/} into .venv"
        if python3 -m venv "$venv" && "$venv/bin/pip" install --quiet --no-compile --disable-pip-version-check -r "$list"; then
            cp "$list" "$stamp"
        else
            complain "the Python packages of $list (needs python3-venv and PyPI)"
        fi
    fi
done

# --- What builds packages; Rust brings all but the linker for Windows
install_debian() {
    tell "installing $*, which needs root: apt-get install -y --no-install-recommends $*"
    if [ "$(id -u)" = 0 ]; then
        { apt-get update && apt-get install -y --no-install-recommends "$@"; } >/dev/null 2>&1
    elif command -v sudo >/dev/null; then
        { sudo -n apt-get update && sudo -n apt-get install -y --no-install-recommends "$@"; } >/dev/null 2>&1
    else
        return 1
    fi
}

# Installs packages where a program of theirs is not there: add_program PROGRAM PACKAGE...
add_program() {
    program=$1
    shift
    PATH="$PATH:/usr/sbin" command -v "$program" >/dev/null || install_debian "$@" ||
        complain "$program (apt-get install -y --no-install-recommends $*)"
}

# Builds a program of Rust where it is not there.
add_cargo() {
    if [ ! -x "$venv/cargo/bin/$1" ]; then
        tell "building $1 into .venv, some minutes"
        cargo install --quiet --locked --root "$venv/cargo" "$1" || complain "$1 (cargo install $1)"
    fi
}

if [ "${1:-}" = book ]; then
    add_cargo mdbook
    exit "$failed"
fi
case "${1:-}" in
    all | packages) add_program x86_64-w64-mingw32-gcc gcc-mingw-w64-x86-64 ;;
esac
if [ "${1:-}" = packages ]; then
    exit "$failed"
fi

# --- rs274, the interpreter of LinuxCNC
cnc="$venv/linuxcnc"
libraries="$cnc/root/usr/lib:$cnc/root/usr/lib/x86_64-linux-gnu"

missing_libraries() {
    for program in "$@"; do
        LD_LIBRARY_PATH="$libraries" ldd "$cnc/root/usr/bin/$program" | awk '/not found/ { print $1 }'
    done | sort -u
}

unpack() {
    # Each package is downloaded once; the name tells which library it brings.
    (cd "$cnc/deb" && apt-get download "$1" >/dev/null 2>"$cnc/apt.log") || { cat "$cnc/apt.log" >&2; return 1; }
    dpkg -x "$cnc/deb/$1"_*.deb "$cnc/root"
}

# The packages of the libraries that these programs lack.
add_libraries() {
    for library in $(missing_libraries "$@"); do
        case "$library" in
            libpython3.11.so*) unpack libpython3.11 && unpack libpython3.11-minimal && unpack libpython3.11-stdlib ;;
            libedit.so*) unpack libedit2 ;;
            libbsd.so*) unpack libbsd0 ;;
            libmd.so*) unpack libmd0 ;;
            libtinfo.so*) unpack libtinfo6 ;;
            libtirpc.so*) unpack libtirpc3 ;;
            libgssapi_krb5.so*) unpack libgssapi-krb5-2 ;;
            libkrb5.so*) unpack libkrb5-3 ;;
            libkrb5support.so*) unpack libkrb5support0 ;;
            libk5crypto.so*) unpack libk5crypto3 ;;
            libcom_err.so*) unpack libcom-err2 ;;
            libkeyutils.so*) unpack libkeyutils1 ;;
            *) printf 'no package is known for %s\n' "$library" >&2; return 1 ;;
        esac || return 1
    done
    [ -z "$(missing_libraries "$@")" ]
}

install_rs274() {
    mkdir -p "$cnc/deb" "$cnc/root"
    unpack linuxcnc-uspace || { apt-get update >/dev/null 2>&1 || true; unpack linuxcnc-uspace; } || return 1
    unpack libboost-python1.74.0 || return 1
    add_libraries rs274 || return 1
    # A tool table of one tool: the interpreter stops without one.
    echo 'T1 P1 D0 Z+0' >"$cnc/tool.tbl"
    cat >"$cnc/rs274" <<SCRIPT
#!/bin/sh
LD_LIBRARY_PATH="$libraries" exec "$cnc/root/usr/bin/rs274" "\$@"
SCRIPT
    chmod +x "$cnc/rs274"
}

if [ ! -x "$cnc/rs274" ]; then
    if [ ! -d "$venv" ]; then
        mkdir -p "$venv"
    fi
    tell "unpacking the G-code interpreter of linuxcnc-uspace into .venv, without root"
    install_rs274 || complain "rs274 of linuxcnc-uspace (needs apt-get, dpkg and the packages of Debian 12)"
fi

# --- The whole controller, for linuxcnc_sim.py: paths that are compiled in become relative ones of the same length, so
# it runs from the unpacked package, without root.
install_controller() {
    add_libraries rtapi_app halcmd halsampler linuxcncrsh linuxcncsvr milltask io || return 1
    for tool in setpriv ipcrm; do
        command -v "$tool" >/dev/null || { printf 'there is no %s (util-linux)\n' "$tool" >&2; return 1; }
    done
    # A running one keeps its file.
    cp "$cnc/root/usr/bin/rtapi_app" "$cnc/rtapi_app" && chmod 755 "$cnc/rtapi_app" || return 1
    sed -i 's|/usr/lib/linuxcnc/modules|.///lib/linuxcnc//modules|g; s|/usr/bin/rtapi_app|.////bin/rtapi_app|g' \
        "$cnc/rtapi_app" && mv "$cnc/rtapi_app" "$cnc/root/usr/bin/rtapi_app" && : >"$cnc/controller.stamp"
}

if [ "${1:-}" = all ] && [ ! -e "$cnc/controller.stamp" ]; then
    tell "making the controller of linuxcnc-uspace run from .venv, without root"
    install_controller || complain "the controller of linuxcnc-uspace in simulation (needs Debian 12 and util-linux)"
fi

# --- Chromium, which opens view.html for tests/browser/view.mjs, and the packages of Node that drive it
if [ "${1:-}" = all ]; then
    add_program chromium chromium
    add_program node nodejs
    add_program npm npm
    list="$root/tests/browser/package.json"
    browser="$venv/browser"
    if ! cmp -s "$list" "$browser/package.stamp"; then
        mkdir -p "$browser"
        cp "$list" "$browser/package.json"
        tell "installing the packages of ${list#"$root"/} into .venv"
        if npm install --prefix "$browser" --no-audit --no-fund --silent >/dev/null; then
            cp "$list" "$browser/package.stamp"
        else
            complain "the packages of $list (needs npm and its registry)"
        fi
    fi
fi

# --- Inkscape's share folder, whose drawings package_drawings.txt lists; it is read, nothing of it is run
if [ "${1:-}" = all ] && [ ! -d "$venv/drawings/root/usr/share/inkscape" ]; then
    drawings="$venv/drawings"
    mkdir -p "$drawings/deb" "$drawings/root"
    fetch() { (cd "$drawings/deb" && apt-get download inkscape >/dev/null 2>&1); }
    tell "unpacking the drawings of inkscape into .venv, without root"
    { fetch || { apt-get update >/dev/null 2>&1 && fetch; }; } && dpkg -x "$drawings"/deb/inkscape_*.deb "$drawings/root" ||
        complain "the drawings of inkscape (needs apt-get, dpkg and the packages of Debian 12)"
fi

# --- Slurm, for the script of docs/how-to/fleet.md: controller, node and munge; the tests start them by themselves
if [ "${1:-}" = all ]; then
    for tool in slurmctld slurmd munged sbatch; do
        add_program "$tool" slurmctld slurmd slurm-client munge
    done
fi

# --- Clean systems, which packages are installed into: Debian as it begins, the same with Python, Wine, and arm64
if [ "${1:-}" = all ]; then
    add_program debootstrap debootstrap
    add_program qemu-aarch64-static qemu-user-static
    [ -x /usr/lib/wine/wine64 ] || install_debian wine wine64 ||
        complain "Wine (apt-get install -y --no-install-recommends wine wine64)"
    systems="$venv/systems"
    mkdir -p "$systems/wheels"
    root_of_debian() {
        name=$1
        shift
        as_root=$([ "$(id -u)" = 0 ] || echo 'sudo -n')
        new=$(mktemp -d) && chmod 755 "$new" &&
            $as_root env PATH="$PATH:/usr/sbin" debootstrap --variant=minbase "$@" bookworm "$new" >"$systems/$name.log" 2>&1 &&
            $as_root tar -C "$new" --exclude ./var/cache/apt -cf "$systems/$name.tar.new" . &&
            mv "$systems/$name.tar.new" "$systems/$name.tar" && $as_root rm -rf "$new"
    }
    if [ ! -e "$systems/debian.tar" ]; then
        tell "making a clean Debian in .venv, a minute or two, which needs root"
        root_of_debian debian || complain "a clean Debian (debootstrap; see $systems/debian.log)"
    fi
    if [ ! -e "$systems/debian-python.tar" ]; then
        tell "making a clean Debian with Python in .venv, a minute or two, which needs root"
        root_of_debian debian-python --include=python3-venv || complain "a clean Debian (debootstrap; see $systems/debian-python.log)"
    fi
    if ! ls "$systems/wheels"/numpy-*.whl >/dev/null 2>&1; then
        "$venv/bin/pip" download --quiet --disable-pip-version-check --only-binary :all: -d "$systems/wheels" numpy ||
            complain "a wheel of numpy (needs PyPI)"
    fi
fi

# --- cargo-deny, which holds licences and sources of the dependencies against deny.toml, and mdbook
if [ "${1:-}" = all ]; then
    add_cargo cargo-deny
    add_cargo mdbook
fi

if [ "$failed" = 0 ]; then
    echo "foreign readers are installed in $venv"
fi
exit "$failed"
