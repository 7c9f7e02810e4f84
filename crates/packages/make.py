"""Builds what users install, into target/packages: `python3 crates/packages/make.py KIND...`.

KIND is `static` (Linux binaries that need no library, x86-64 and arm64), `deb` (for Debian and Ubuntu, with manual
pages and completions), `wheel` (for Python: the binary and readers of job folders), `windows` (a zip with terrace.exe),
`sums` (SHA256SUMS of all that is there, with the list of parts, an SBOM in CycloneDX), or `table` (all of these, built
anew, with sizes and times for docs/developing/release.md). All carry the licences of
everything that is inside. Same commit, same toolchain: same bytes.

It needs cargo, rustup, python3, and but for Windows cargo-zigbuild and zig; `deb` needs dpkg-deb, `wheel` needs maturin,
`windows` needs x86_64-w64-mingw32-gcc. `make packages` installs them and makes all.
"""

from __future__ import annotations

import email.utils
import gzip
import hashlib
import io
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tarfile
import time
import tomllib
import zipfile

import notices

ROOT = pathlib.Path(__file__).resolve().parents[2]
HERE = ROOT / "crates/packages"
OUT = ROOT / "target/packages"
VERSION = tomllib.loads((ROOT / "Cargo.toml").read_text())["workspace"]["package"]["version"]
X86, ARM, WINDOWS = "x86_64-unknown-linux-musl", "aarch64-unknown-linux-musl", "x86_64-pc-windows-gnu"
DEBIAN_ARCHITECTURE = {X86: "amd64", ARM: "arm64"}
# The same for cargo and maturin, which then takes what is built.
BUILD = ["--release", "--locked", "--quiet", "--config", "profile.release.strip=true"]
COMPLETIONS = {
    "bash": "usr/share/bash-completion/completions/terrace",
    "zsh": "usr/share/zsh/vendor-completions/_terrace",
    "fish": "usr/share/fish/vendor_completions.d/terrace.fish",
}


def run(*command: str | os.PathLike[str], folder: pathlib.Path = ROOT, environment: dict[str, str] | None = None) -> bytes:
    return subprocess.run(command, check=True, cwd=folder, stdout=subprocess.PIPE, env=environment).stdout


def commit_time() -> int:
    """Seconds; every file in a package has this date."""
    return int(os.environ.get("SOURCE_DATE_EPOCH") or run("git", "log", "-1", "--format=%ct"))


def build_environment() -> dict[str, str]:
    # Paths of the builder's machine stay out of messages of a panic.
    home = os.environ.get("CARGO_HOME") or str(pathlib.Path.home() / ".cargo")
    sysroot = run("rustc", "--print", "sysroot").decode().strip()
    flags = [f"--remap-path-prefix={old}={new}" for old, new in ((home, "cargo"), (sysroot, "rust"), (ROOT, "terrace"))]
    return {
        **os.environ,
        "CARGO_ENCODED_RUSTFLAGS": "\x1f".join(flags),
        "CARGO_INCREMENTAL": "0",
        "SOURCE_DATE_EPOCH": str(commit_time()),
    }


def binary(target: str) -> pathlib.Path:
    """Builds terrace for a target, stripped."""
    run("rustup", "--quiet", "target", "add", target)
    # zig is compiler, linker and musl for both processors. Its memcpy is as fast as that of glibc; the one in the musl
    # that Rust brings is not.
    build = "build" if target == WINDOWS else "zigbuild"
    run("cargo", build, *BUILD, "--target", target, environment=build_environment())
    folder = pathlib.Path(os.environ.get("CARGO_TARGET_DIR") or ROOT / "target")
    return folder / target / "release" / ("terrace.exe" if target == WINDOWS else "terrace")


def documents(target: str) -> dict[str, bytes]:
    """What lies beside every binary: introduction, documentation, licences."""
    names = ["README.md", "CHANGELOG.md"]
    files = {name: (ROOT / name).read_bytes() for name in names}
    pages = (path for path in sorted((ROOT / "docs").rglob("*")) if path.is_file())
    files |= {str(path.relative_to(ROOT)): path.read_bytes() for path in pages}
    return files | licences(target)


def licences(target: str) -> dict[str, bytes]:
    """The texts that must lie beside a binary."""
    standard_library = notices.rust_documents() / "COPYRIGHT-library.html"
    return {
        "LICENSE": (ROOT / "LICENSE").read_bytes(),
        "THIRD-PARTY.txt": notices.text(ROOT, target).encode(),
        "rust-standard-library.html": standard_library.read_bytes(),
    }


def manual_pages(terrace: pathlib.Path) -> dict[str, bytes]:
    folder = OUT / "man"
    shutil.rmtree(folder, ignore_errors=True)
    run(terrace, "man", "-o", folder)
    pages = {path.name: path.read_bytes() for path in sorted(folder.iterdir())}
    shutil.rmtree(folder)
    return pages


def completions(terrace: pathlib.Path) -> dict[str, bytes]:
    return {shell: run(terrace, "completions", shell) for shell in [*COMPLETIONS, "powershell"]}


def compressed(data: bytes) -> bytes:
    out = io.BytesIO()
    with gzip.GzipFile(fileobj=out, mode="wb", filename="", mtime=0, compresslevel=9) as file:
        file.write(data)
    return out.getvalue()


def write_tar(path: pathlib.Path, files: dict[str, bytes], programs: set[str]) -> None:
    plain = io.BytesIO()
    with tarfile.open(fileobj=plain, mode="w", format=tarfile.GNU_FORMAT) as tar:
        for name, data in sorted(files.items()):
            entry = tarfile.TarInfo(name)
            entry.size, entry.mtime, entry.mode = len(data), commit_time(), 0o755 if name in programs else 0o644
            tar.addfile(entry, io.BytesIO(data))
    path.write_bytes(compressed(plain.getvalue()))


def static() -> None:
    # Manual pages and completions are the same for every system; the builder can run this one.
    native = binary(X86)
    shared = {f"man/{name}": page for name, page in manual_pages(native).items()}
    shared |= {f"completions/terrace.{shell}": text for shell, text in completions(native).items()}
    for target in (X86, ARM):
        name = f"terrace-{VERSION}-{target}"
        files = {"terrace": binary(target).read_bytes(), **documents(target), **shared}
        write_tar(OUT / f"{name}.tar.gz", {f"{name}/{file}": data for file, data in files.items()}, {f"{name}/terrace"})


def deb() -> None:
    native = binary(X86)
    for target, architecture in DEBIAN_ARCHITECTURE.items():
        files = {"usr/bin/terrace": binary(target).read_bytes()}
        for name, page in manual_pages(native).items():
            files[f"usr/share/man/man1/{name}.gz"] = compressed(page)
        for shell, text in completions(native).items():
            if shell in COMPLETIONS:
                files[COMPLETIONS[shell]] = text
        doc = "usr/share/doc/terrace"
        files |= {f"{doc}/{name}": data for name, data in documents(target).items() if name != "LICENSE"}
        files[f"{doc}/copyright"] = debian_copyright().encode()
        files[f"{doc}/changelog.gz"] = compressed(debian_changelog().encode())
        write_deb(files, architecture)


def debian_copyright() -> str:
    """LICENSE without the text of the Apache licence, which every Debian has."""
    before, mit, _ = re.split("^=+$", (ROOT / "LICENSE").read_text(), flags=re.MULTILINE)
    return f"{before}{mit}On Debian systems, the Apache License, Version 2.0, is in /usr/share/common-licenses/Apache-2.0.\n"


def debian_changelog() -> str:
    maintainer = next(line for line in (HERE / "control").read_text().splitlines() if line.startswith("Maintainer: "))
    date = email.utils.formatdate(commit_time())
    return (
        f"terrace ({VERSION}) stable; urgency=medium\n\n  * What changed is in CHANGELOG.md.\n\n"
        f" -- {maintainer.removeprefix('Maintainer: ')}  {date}\n"
    )


def write_deb(files: dict[str, bytes], architecture: str) -> None:
    stage = OUT / "deb"
    shutil.rmtree(stage, ignore_errors=True)
    for name, data in files.items():
        path = stage / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
        path.chmod(0o755 if name.startswith("usr/bin/") else 0o644)
    for folder in [stage, *(path for path in stage.rglob("*") if path.is_dir())]:
        folder.chmod(0o755)
    control = stage / "DEBIAN"
    control.mkdir(mode=0o755)
    size = sum(len(data) for data in files.values()) // 1024
    text = (HERE / "control").read_text()
    (control / "control").write_text(text.format(version=VERSION, architecture=architecture, size=size))
    sums = "".join(f"{hashlib.md5(data).hexdigest()}  {name}\n" for name, data in sorted(files.items()))
    (control / "md5sums").write_text(sums)
    package = OUT / f"terrace_{VERSION}_{architecture}.deb"
    environment = {**os.environ, "SOURCE_DATE_EPOCH": str(commit_time())}
    run("dpkg-deb", "--root-owner-group", "-Zxz", "--build", stage, package, environment=environment)
    shutil.rmtree(stage)


def wheel() -> None:
    binary(X86)
    python = HERE / "python"
    for name, data in licences(X86).items():
        (python / name).write_bytes(data)
    options = ["--target", X86, "--compatibility", "manylinux2014"]
    environment = {**build_environment(), "CARGO": str(HERE / "cargo-zig")}
    run("maturin", "build", *BUILD, *options, "--out", OUT, folder=python, environment=environment)


def windows() -> None:
    files = {"terrace.exe": binary(WINDOWS).read_bytes(), **documents(WINDOWS)}
    files["completions/terrace.ps1"] = completions(binary(X86))["powershell"]
    name = f"terrace-{VERSION}-{WINDOWS}"
    date = time.gmtime(commit_time())[:6]
    with zipfile.ZipFile(OUT / f"{name}.zip", "w", zipfile.ZIP_DEFLATED, compresslevel=9) as out:
        for file, data in sorted(files.items()):
            out.writestr(zipfile.ZipInfo(f"{name}/{file}", date), data, zipfile.ZIP_DEFLATED, 9)


def sums() -> None:
    # maturin lists every crate that is built into the wheel; the other packages hold the same ones.
    (made,) = OUT.glob("terrace_laser-*.whl")
    with zipfile.ZipFile(made) as zipped:
        (name,) = (name for name in zipped.namelist() if name.endswith(".cyclonedx.json"))
        (OUT / f"terrace-{VERSION}.cdx.json").write_bytes(zipped.read(name))
    files = (path for path in packages() if path.name != "SHA256SUMS")
    lines = (f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in files)
    (OUT / "SHA256SUMS").write_text("".join(lines))


def table() -> None:
    """Builds each binary anew, and writes sizes and times into docs/developing/release.md."""
    folder = pathlib.Path(os.environ.get("CARGO_TARGET_DIR") or ROOT / "target")
    lines = ["| target | build, min | binary, MB |", "|---|---|---|"]
    for target in (X86, ARM, WINDOWS):
        shutil.rmtree(folder / target, ignore_errors=True)
        begin = time.monotonic()
        size = binary(target).stat().st_size
        lines.append(f"| `{target}` | {(time.monotonic() - begin) / 60:.1f} | {size / 1e6:.1f} |")
    for kind in (static, deb, wheel, windows, sums):
        kind()
    lines += ["", f"Built with {os.cpu_count()} cores.", "", "| package | MB |", "|---|---|"]
    lines += [f"| `{path.name}` | {path.stat().st_size / 1e6:.1f} |" for path in packages() if path.name != "SHA256SUMS"]
    page = ROOT / "docs/developing/release.md"
    before, _, rest = page.read_text().partition("<!-- packages: make package-table writes this -->\n")
    _, end, after = rest.partition("<!-- end of packages -->")
    page.write_text(f"{before}<!-- packages: make package-table writes this -->\n" + "\n".join([*lines, end]) + after)


def packages() -> list[pathlib.Path]:
    return sorted(path for path in OUT.iterdir() if path.is_file())


KINDS = {"static": static, "deb": deb, "wheel": wheel, "windows": windows, "sums": sums, "table": table}


def main() -> None:
    kinds = sys.argv[1:]
    unknown = [kind for kind in kinds if kind not in KINDS]
    if unknown or not kinds:
        sys.exit(f"usage: make.py KIND..., of {', '.join(KINDS)}" + (f"; not {' '.join(unknown)}" if unknown else ""))
    OUT.mkdir(parents=True, exist_ok=True)
    for kind in kinds:
        KINDS[kind]()
    for path in packages():
        print(f"{path.stat().st_size / 1e6:8.1f} MB  {path.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
