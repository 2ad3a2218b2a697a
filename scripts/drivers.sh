#!/usr/bin/env bash
# Fetches the software Vulkan drivers that `make test-drivers` runs on, beside the system and without touching it:
#   mesa-22      lavapipe of Debian bookworm (22.3, no ray query)
#   mesa-25      lavapipe of bookworm-backports (25.0, with ray query)
#   swiftshader  the libvk_swiftshader.so of Debian's chromium
# and in `layers` the validation layer that chromium brings, newer than bookworm's own.
# Each is unpacked by `dpkg -x` into a folder of its own under ${XDG_CACHE_HOME:-~/.cache}/sunfleck/drivers, with the
# libraries it needs and an ICD file. Nothing is installed, no source list of the system is read or changed: apt-get
# runs on lists of its own in that folder. What is there already is left alone; scripts/with-driver.sh uses it.
set -euo pipefail

cache="${XDG_CACHE_HOME:-$HOME/.cache}/sunfleck/drivers"
apt="$cache/apt"

say() { echo "drivers: $*" >&2; }
fail() {
    say "$@"
    exit 1
}

complete() { [ -e "$cache/$1/complete" ]; }
if complete mesa-22 && complete mesa-25 && complete swiftshader; then
    exit 0
fi

for tool in apt-get dpkg-deb; do
    command -v $tool >/dev/null || fail "$tool is missing: the drivers are unpacked from Debian's packages, which" \
        "needs Debian or Ubuntu. Elsewhere run the tests on the drivers of the system: 'make test'"
done
mkdir -p "$apt/lists/partial" "$apt/archives/partial" "$apt/sources.d"

# The mirror that the system itself uses, where it is Debian; else Debian's own.
debian_mirror() {
    local uri
    uri=$(apt-get indextargets --format '$(REPO_URI) $(CODENAME)' 'Created-By: Packages' 2>/dev/null |
        awk '$1 ~ /\/debian\/?$/ { print $1; exit }' || true)
    echo "${SUNFLECK_DEBIAN_MIRROR:-${uri:-http://deb.debian.org/debian}}"
}

# Debian's signing keys: the system's, or (Ubuntu) those of the package that holds them.
debian_keyring() {
    local keyring=/usr/share/keyrings/debian-archive-keyring.gpg
    if [ ! -e $keyring ]; then
        (cd "$apt/archives" && apt-get download -qq debian-archive-keyring >&2 &&
            dpkg-deb -x debian-archive-keyring_*.deb "$apt/keys") ||
            fail "Debian's signing keys are missing; install the package debian-archive-keyring"
        keyring="$apt/keys/$keyring"
    fi
    echo "$keyring"
}

# apt-get with lists, an archive folder and a (blank) package state of its own; the system's proxies stay in force.
private_apt() { apt-get -qq -c "$apt/apt.conf" "$@"; }

prepare_apt() {
    local mirror keyring
    mirror=$(debian_mirror)
    keyring=$(debian_keyring)
    : >"$apt/status"
    cat >"$apt/sources.list" <<EOF
deb [signed-by=$keyring] $mirror bookworm main
deb [signed-by=$keyring] $mirror bookworm-backports main
EOF
    cat >"$apt/apt.conf" <<EOF
#clear APT::Update::Post-Invoke;
#clear APT::Update::Post-Invoke-Success;
#clear DPkg::Post-Invoke;
Dir::State "$apt";
Dir::State::lists "$apt/lists";
Dir::State::status "$apt/status";
Dir::Cache "$apt";
Dir::Cache::archives "$apt/archives";
Dir::Etc::sourcelist "$apt/sources.list";
Dir::Etc::sourceparts "$apt/sources.d";
Dir::Etc::preferencesparts "$apt/sources.d";
APT::Sandbox::User "$(id -un)";
APT::Install-Recommends "false";
Acquire::Languages "none";
Acquire::Retries "3";
EOF
    say "reading Debian's package lists"
    private_apt update >&2 || fail "Debian's package lists could not be read from $mirror; set SUNFLECK_DEBIAN_MIRROR"
}

# Packages that a driver must share with the program that loads it, or that hold no library: never unpacked.
shared='^(libvulkan1|libc6|libc-bin|libcrypt1|libgcc-s1|gcc-.*-base|libstdc\+\+6|debconf|cdebconf.*|perl-.*|dpkg|tar|.*-data|.*-common)$'

# fetch_mesa NAME SUITE: lavapipe and every library it needs, from that suite.
fetch_mesa() {
    local name=$1 suite=$2 folder="$cache/$1" plan action package version library
    complete "$name" && return
    say "fetching $name: mesa-vulkan-drivers of $suite and the libraries it needs"
    rm -rf "$folder"
    mkdir -p "$folder/root"
    # The closure of the dependencies, as apt-get would install it on a system without any package:
    # lines "Inst PACKAGE (VERSION ...)". In the names of the files the colon of a version is %3a.
    plan=$(private_apt install --simulate -t "$suite" mesa-vulkan-drivers)
    private_apt install --download-only -y -t "$suite" mesa-vulkan-drivers >&2
    while read -r action package version _; do
        [ "$action" = Inst ] && [[ ! "$package" =~ $shared ]] || continue
        version=${version#(}
        dpkg-deb -x "$apt/archives/${package}_${version//:/%3a}"_*.deb "$folder/root"
    done <<<"$plan"
    rm -rf "$folder/root/usr/share"
    library=$(find "$folder/root" -name libvulkan_lvp.so | head -n 1)
    [ -n "$library" ] || fail "mesa-vulkan-drivers of $suite holds no lavapipe"
    write_icd "$folder/icd.json" "$library"
    check_library "$name" "$library" "$(dirname "$library"):$folder/root/lib/$(basename "$(dirname "$library")")"
    touch "$folder/complete"
}

fetch_swiftshader() {
    local folder="$cache/swiftshader" layers="$cache/layers" library
    complete swiftshader && return
    say "fetching swiftshader: Debian's chromium-common, of which two libraries are kept"
    rm -rf "$folder" "$layers"
    mkdir -p "$folder" "$layers"
    (
        cd "$apt/archives"
        rm -f chromium-common_*.deb # one from an interrupted run may be cut short
        private_apt download chromium-common >&2
        dpkg-deb --fsys-tarfile chromium-common_*.deb | tar -x -C "$folder" --strip-components=4 \
            ./usr/lib/chromium/libvk_swiftshader.so ./usr/lib/chromium/libVkLayer_khronos_validation.so
    )
    mv "$folder/libVkLayer_khronos_validation.so" "$layers/"
    cat >"$layers/VkLayer_khronos_validation.json" <<EOF
{
  "file_format_version": "1.2.0",
  "layer": {
    "name": "VK_LAYER_KHRONOS_validation",
    "type": "GLOBAL",
    "library_path": "./libVkLayer_khronos_validation.so",
    "api_version": "1.4.0",
    "implementation_version": "1",
    "description": "Khronos validation layer",
    "instance_extensions": [
      { "name": "VK_EXT_debug_report", "spec_version": "9" },
      { "name": "VK_EXT_debug_utils", "spec_version": "2" },
      { "name": "VK_EXT_layer_settings", "spec_version": "2" },
      { "name": "VK_EXT_validation_features", "spec_version": "6" }
    ]
  }
}
EOF
    library="$folder/libvk_swiftshader.so"
    write_icd "$folder/icd.json" "$library"
    check_library swiftshader "$library" ""
    touch "$folder/complete"
}

write_icd() {
    cat >"$1" <<EOF
{ "file_format_version": "1.0.0", "ICD": { "library_path": "$2", "api_version": "1.3.0" } }
EOF
}

# Names what the dynamic linker does not find, instead of a loader that silently skips the driver.
check_library() {
    local missing
    missing=$(LD_LIBRARY_PATH="$3" ldd "$2" 2>&1 | grep -E 'not found' || true)
    [ -z "$missing" ] || fail "$1 does not load on this system:"$'\n'"$missing"
}

prepare_apt
fetch_mesa mesa-22 bookworm
fetch_mesa mesa-25 bookworm-backports
fetch_swiftshader
rm -rf "$apt"
say "ready in $cache"
