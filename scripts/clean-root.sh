#!/usr/bin/env bash
# Tries the set-up where nothing is installed: makes a Debian bookworm with only the base system, git, make, a C
# compiler and this machine's Rust toolchain in FOLDER, clones HEAD into it and runs make targets inside (chroot).
#   sudo scripts/clean-root.sh FOLDER [TARGET]...        TARGET: demo (the default), test, test-drivers, lint
# A FOLDER that holds a finished root is used again with a fresh clone; remove it to begin anew. Packages are taken
# from the mirror that this machine's apt uses, crates as its cargo is configured.
set -euo pipefail

say() { echo "clean-root: $*" >&2; }
fail() {
    say "$@"
    exit 1
}

[ $# -ge 1 ] || fail "usage: scripts/clean-root.sh FOLDER [TARGET]..."
[ "$(id -u)" -eq 0 ] || fail "chroot and mount need root; run it by sudo"
command -v debootstrap >/dev/null || fail "debootstrap is missing; run: apt-get install debootstrap"
source=$(cd "$(dirname "$0")/.." && pwd)
mkdir -p "$1"
root=$(cd "$1" && pwd)
shift
[ $# -gt 0 ] || set -- demo

make_root() {
    local mirror toolchain
    mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' | grep -E '/debian/?$' | head -n 1 || true)
    say "debootstrap into $root"
    [ -z "$(ls -A "$root")" ] || fail "$root is not empty and holds no finished root; remove it or take another folder"
    debootstrap --variant=minbase --include=git,make,gcc,libc6-dev,ca-certificates bookworm "$root" \
        "${mirror:-http://deb.debian.org/debian}" >&2
    # How this machine reaches its mirror (proxy, certificates) is no part of what is tried.
    cp -L /etc/resolv.conf /etc/hosts "$root/etc/"
    cp /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/"
    grep -rlE 'Acquire::.*(Proxy|Verify|Check)' /etc/apt/apt.conf.d /etc/apt/apt.conf 2>/dev/null |
        xargs -r cp -t "$root/etc/apt/apt.conf.d/" || true
    toolchain=$(rustc --print sysroot)
    mkdir -p "$root/opt/rust"
    cp -a "$toolchain/." "$root/opt/rust/"
    rm -rf "$root/opt/rust/share/doc"
    mkdir -p "$root/root/.cargo"
    cp "${CARGO_HOME:-$HOME/.cargo}"/config* "$root/root/.cargo/" 2>/dev/null || true
    touch "$root/complete"
}

unmount() {
    local name
    for name in dev/shm dev proc sys; do
        mountpoint -q "$root/$name" && umount "$root/$name"
    done
    return 0
}

[ -e "$root/complete" ] || make_root
trap unmount EXIT
for name in proc sys dev; do
    mountpoint -q "$root/$name" || mount --bind "/$name" "$root/$name"
done
rm -rf "$root/root/sunfleck"
git clone --quiet --no-hardlinks "$source" "$root/root/sunfleck"

for target in "$@"; do
    start=$SECONDS
    chroot "$root" /usr/bin/env -i HOME=/root LANG=C.UTF-8 TERM=dumb \
        PATH=/opt/rust/bin:/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
        http_proxy="${http_proxy:-}" https_proxy="${https_proxy:-}" \
        make -C /root/sunfleck "$target" || fail "make $target failed after $((SECONDS - start)) s"
    say "make $target: $((SECONDS - start)) s"
done
