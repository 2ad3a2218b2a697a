# The commands of the project's set-up and its checks; `make help` lists them. Everything goes through `make deps`.
.PHONY: help deps build demo bench bench-short bench-peers bench-peers-short bench-speed bench-gpu bench-gpu-short test test-drivers e2e e2e-if-possible stress lint references gallery clean
.DEFAULT_GOAL := help

help: ## lists these commands
	@echo "Sunfleck, a headless path tracer on Vulkan compute. Commands:"
	@sed -n 's/^\([a-z0-9-]*\):[^#]*## \(.*\)/  make \1 \t\2/p' $(MAKEFILE_LIST) | expand -t 26

deps: ## installs what is missing (apt-get on Debian and Ubuntu; elsewhere says what is needed)
	@scripts/deps.sh

build: deps ## builds the program, optimised
	cargo build --release

demo: build ## renders scenes/cornell_spheres.gltf to out/demo.exr and out/demo.png
	@mkdir -p out
	cargo run --release --quiet -- render scenes/cornell_spheres.gltf -o out/demo.exr -o out/demo.png \
		--resolution 512x512 --spp 64 --exposure 1 --tonemap exponential
	@ls -lh out/demo.exr out/demo.png

bench: build ## measures run time against error on the standard suite, to out/bench (a quarter of an hour on two cores)
	cargo run --release --quiet -- bench standard -o out/bench

bench-short: build ## the same on the short suite (under a minute)
	cargo run --release --quiet -- bench short -o out/bench-short --strict

test: deps ## builds and runs every test on the device of this machine
	cargo test

test-drivers: deps ## runs the tests of the GPU on lavapipe 22, lavapipe 25 (both back ends) and SwiftShader
	@scripts/test-drivers.sh

e2e: build ## drives the page of `watch` in headless Chromium (wants node and chromium; SUNFLECK_E2E_INSTALL=1 installs them)
	@scripts/e2e.sh

e2e-if-possible: build ## the same for CI: where node or chromium is missing, it says so and is left out
	@scripts/e2e.sh --skip

stress: deps ## numbers under stress, in full, on the device of this machine (a quarter of an hour and more)
	SUNFLECK_STRESS=full cargo test --test stress -- --nocapture --test-threads 1

lint: deps ## formatting, clippy and the documentation's links
	cargo fmt --check
	cargo clippy --all-targets -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --no-deps --document-private-items

references: ## makes the reference images and values again with Mitsuba 3 (a quarter of an hour)
	python3 tests/reference/make_references.py
	python3 tests/reference/make_bsdf_table.py
	python3 tests/reference/make_bsdf_images.py

bench-peers: build ## time against error beside Mitsuba 3, Cycles and LuxCore, seven scenes (a quarter of an hour)
	python3 benches/peers/run.py

bench-peers-short: build ## the short form of it for CI: Mitsuba alone, one scene
	python3 benches/peers/run.py --short

bench-speed: build ## million paths a second beside Mitsuba 3, five scenes (a few minutes)
	python3 benches/peers/speed.py

bench-gpu: build ## a report on this machine's GPU: paths a second, back ends, starts, kernels (half an hour)
	python3 benches/peers/gpu.py

bench-gpu-short: build ## its steps in their smallest form, on whatever device there is (five minutes)
	python3 benches/peers/gpu.py --short

gallery: build ## renders other people's models to docs/gallery (MODELS=FOLDER; a quarter of an hour on two cores)
	@test -n "$(MODELS)" || { echo "say where the models are: make gallery MODELS=FOLDER" >&2; exit 2; }
	python3 scripts/gallery.py "$(MODELS)"

clean: ## removes what was built and rendered
	cargo clean
	rm -rf out
