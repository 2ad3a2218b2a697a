#!/usr/bin/env bash
# Runs the tests that touch a Vulkan device on every software driver in turn (`make test-drivers`), lavapipe 25 with
# both trace back ends, and prints a table. Arguments go to `cargo test`, for example
#   scripts/test-drivers.sh --test gpu furnace
# and SUNFLECK_DRIVERS="mesa-22 swiftshader" chooses the runs (names as in the table). SUNFLECK_DRIVERS_FORM=short takes a
# third of the time (see below). SUNFLECK_SYSTEM_TESTED=1 says that
# the tests have just run on this machine's own driver: mesa-22 is then left out where it is that very driver.
set -euo pipefail

cd "$(dirname "$0")/.."
runs=${SUNFLECK_DRIVERS:-"mesa-22 mesa-25-bvh mesa-25-ray-query swiftshader"}

scripts/drivers.sh

# These test binaries touch a device; the others need no repetition, nor does the arithmetic of `bench`. The stress suite takes
# a run of its own: scripts/test-drivers.sh --test stress. The short form leaves out what is no driver's doing: the arithmetic
# of the error estimate, which the host does, the agreement of estimators and with other
# renderers, and the deliberate bugs: that a test notices one is shown on one driver.
form=${SUNFLECK_DRIVERS_FORM:-full}
left_out=()
if [ "$form" = short ]; then
    for name in error_estimate mutations agreement mitsuba_images bitterli; do left_out+=(--skip "$name"); done
fi
default=(--test gpu --test cli -- --skip bench:: "${left_out[@]}")
cargo test --quiet --no-run "${@:-${default[@]}}"

# Whether the device that is taken by default is lavapipe, and its library the one that drivers.sh fetched as mesa-22.
is_system_driver() {
    local fetched system
    cargo run --quiet -- devices 2>&1 | head -n 1 | grep -q '^0: llvmpipe.*taken by default' || return 1
    fetched=$(find "${XDG_CACHE_HOME:-$HOME/.cache}/sunfleck/drivers/mesa-22/root" -name libvulkan_lvp.so | head -n 1)
    system=$(find /usr/lib -name libvulkan_lvp.so 2>/dev/null | head -n 1)
    [ -n "$fetched" ] && [ -n "$system" ] && cmp -s "$fetched" "$system"
}

# What a run's `cargo test` gets: the caller's arguments, or the default. Tests of single shader functions, and the
# command line's, know nothing of how rays are traced: on lavapipe 25 they run once, with the BVH.
arguments_of() {
    if [ $# -gt 1 ]; then
        printf '%s\n' "${@:2}"
    elif [ "$1" = mesa-25-ray-query ]; then
        printf '%s\n' --test gpu -- "${left_out[@]}"
        printf -- '--skip\n%s\n' bsdf_ mitsuba_bsdfs environment_chi_square layout light_sampling sampler shader_math shader_test shaders_valid sobol:: texture::
    else
        printf '%s\n' "${default[@]}"
    fi
}

table=""
failed=0
for run in $runs; do
    driver=$run
    unset SUNFLECK_TEST_TRACE
    case "$run" in
    *-bvh) driver=${run%-bvh} && export SUNFLECK_TEST_TRACE=bvh ;;
    *-ray-query) driver=${run%-ray-query} && export SUNFLECK_TEST_TRACE=ray-query ;;
    esac
    if [ "$run" = mesa-22 ] && [ -n "${SUNFLECK_SYSTEM_TESTED:-}" ] && is_system_driver; then
        table+=$(printf '%-20s %s' "$run" "is this system's driver, on which the tests have run")$'\n'
        continue
    fi
    echo "==== $run" >&2
    start=$SECONDS
    log=$(mktemp)
    mapfile -t arguments < <(arguments_of "$run" "$@")
    if scripts/with-driver.sh "$driver" cargo test --no-fail-fast "${arguments[@]}" 2>&1 | tee "$log"; then
        result=ok
    else
        result=FAILED
        failed=1
    fi
    passed=$(awk '/^test result:/ { p += $4; f += $6; i += $8 } END { printf "%6d %7d %8d", p, f, i }' "$log")
    rm -f "$log"
    table+=$(printf '%-20s %-7s %s %8d' "$run" "$result" "$passed" $((SECONDS - start)))$'\n'
done
printf '\n%-20s %-7s %6s %7s %8s %8s\n%s' driver result passed failed ignored seconds "$table"
exit $failed
