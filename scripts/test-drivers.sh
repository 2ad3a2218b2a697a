#!/usr/bin/env bash
# Runs the tests that touch a Vulkan device on every software driver in turn (`make test-drivers`), lavapipe 25 with
# both trace back ends, and prints a table. Arguments go to `cargo test`, for example
#   scripts/test-drivers.sh --test gpu furnace
# and SUNFLECK_DRIVERS="mesa-22 swiftshader" chooses the runs (names as in the table).
set -euo pipefail

cd "$(dirname "$0")/.."
runs=${SUNFLECK_DRIVERS:-"mesa-22 mesa-25-bvh mesa-25-ray-query swiftshader"}

scripts/drivers.sh

# These test binaries touch a device; the others need no repetition.
[ $# -gt 0 ] || set -- --test gpu --test cli
cargo test --quiet --no-run "$@"

table=""
failed=0
for run in $runs; do
    driver=$run
    unset SUNFLECK_TEST_TRACE
    case "$run" in
    *-bvh) driver=${run%-bvh} && export SUNFLECK_TEST_TRACE=bvh ;;
    *-ray-query) driver=${run%-ray-query} && export SUNFLECK_TEST_TRACE=ray-query ;;
    esac
    echo "==== $run" >&2
    start=$SECONDS
    log=$(mktemp)
    if scripts/with-driver.sh "$driver" cargo test --no-fail-fast "$@" 2>&1 | tee "$log"; then
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
