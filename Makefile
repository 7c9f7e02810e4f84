# terrace: `make demo` shows what it does, `make test` proves it. Both set up what they need.
CARGO ?= cargo
DEMO := target/demo/hood.job

.PHONY: demo test tests test-all check bench sources method-table method-pictures book setup setup-all clean
.PHONY: packages package-static package-deb package-wheel package-windows package-table setup-packages

# Compiles leather on a car hood, verifies it, and says where everything lies.
demo:
	@echo "building terrace: some minutes the first time, nothing after that"
	$(CARGO) build --release
	@echo "compiling leather on a car hood into $(DEMO), and verifying it"
	$(CARGO) run --release --quiet -- compile fixtures/hood.toml --verify -o $(DEMO)
	$(CARGO) run --release --quiet -- verify $(DEMO)
	@echo
	@echo "pictures:  $(DEMO)/view.html (in 3D, open it in a browser)  $(DEMO)/layout.svg  $(DEMO)/report.html"
	@echo "programs:  $(DEMO)/stage.ngc  $(DEMO)/stage_m0.nc  $(DEMO)/blocks/*.dxf  $(DEMO)/job.ovf"
	@echo "operator:  $(DEMO)/runsheet.txt"

# The tests of every change; installs the foreign readers first.
test: setup tests
	$(CARGO) test

# Builds them; with -j beside the set-up.
tests:
	$(CARGO) test --no-run

# The slow ones too, and those that read ../shared; they fail where it is absent. Lints first, then
# every test, whatever failed before it.
test-all: setup-all check
	$(CARGO) test --no-fail-fast --profile test-all -- --include-ignored

# What users install, into target/packages, with checksums and the list of parts; each kind has a command of its own.
PACKAGE := PATH="$(CURDIR)/.venv/bin:$$PATH" python3 crates/packages/make.py

packages: setup-packages
	$(PACKAGE) static deb wheel windows sums

package-static package-deb package-wheel package-windows: setup-packages
	$(PACKAGE) $(@:package-%=%)

# All of them, built anew, with sizes and times for docs/developing/release.md.
package-table: setup-packages
	$(PACKAGE) table

# The book of docs, with search, into target/book.
book:
	sh tests/python/setup.sh book
	PATH="$(CURDIR)/.venv/cargo/bin:$$PATH" mdbook build docs

# Formatting, lints, documentation.
check:
	$(CARGO) fmt --all --check
	$(CARGO) clippy --all-targets -- -D warnings
	$(CARGO) clippy --no-default-features -- -D warnings
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --no-deps --document-private-items
	PATH="$(CURDIR)/.venv/cargo/bin:$$PATH" $(CARGO) deny check bans licenses sources
	PATH="$(CURDIR)/.venv/cargo/bin:$$PATH" mdbook build docs

# Speed and memory on three sizes, speed of the writers, of the pictures, of the view in a browser and of reading drawings, stops against their lower bounds, quality of orders, on the fly, heights of NURBS surfaces, a fleet; prints tables.
bench: setup-all
	$(CARGO) bench --bench job
	$(CARGO) bench --bench emit
	$(CARGO) bench --bench pictures
	$(CARGO) bench --bench view
	$(CARGO) bench --bench partition
	$(CARGO) bench --bench order
	$(CARGO) bench --bench on_the_fly
	$(CARGO) bench --bench compare
	$(CARGO) bench --bench texture
	$(CARGO) bench --bench nurbs
	$(CARGO) bench --bench fleet

# The tables of figures in docs/explanation/compare.md, from the jobs of fixtures/sources and the hood; some minutes.
sources:
	SOURCES=write $(CARGO) test --profile test-all --test it sources:: -- --include-ignored

# The table of docs/explanation/method.md: every method on real parts of ../shared, each result verified; some minutes.
method-table:
	METHOD_TABLE=docs/explanation/method.md $(CARGO) test --profile test-all --test it method:: -- --ignored --nocapture

# The pictures of docs/explanation/method.md.
method-pictures:
	$(CARGO) build --release --quiet
	for m in contour window tilt; do sed "s/\"contour\"/\"$$m\"/" fixtures/method.toml | \
		(cd fixtures && $(CARGO) run --release --quiet -- preview - -o ../docs/explanation/method-$$m.svg); done

setup:
	sh tests/python/setup.sh

setup-all:
	sh tests/python/setup.sh all

setup-packages:
	sh tests/python/setup.sh packages

clean:
	$(CARGO) clean
	rm -rf .venv
