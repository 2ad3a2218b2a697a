#!/usr/bin/env bash
# Makes sure that everything the build and the tests need is there (`make deps`).
#
# On Debian and Ubuntu it installs by apt-get what is missing, and only that: a Vulkan loader, a software driver, the
# validation layer, shaderc with its relatives, a C++ compiler. Elsewhere it says what to install and stops.
# Then it puts a libshaderc_combined.a that links into .deps/shaderc, where .cargo/config.toml points the build.
set -euo pipefail

root=$(cd "$(dirname "$0")/.." && pwd)
target="$root/.deps/shaderc"
archive="$target/libshaderc_combined.a"

say() { echo "deps: $*" >&2; }
fail() {
    say "$@"
    exit 1
}

have_library() { # true if the dynamic linker knows the library
    local known
    known=$(/sbin/ldconfig -p 2>/dev/null || true)
    [[ "$known" == *[[:space:]]"$1 "* ]]
}

have_json() { # true if a Vulkan manifest of this kind (icd.d, explicit_layer.d) matches the pattern
    local folder
    for folder in /usr/share/vulkan /usr/local/share/vulkan /etc/vulkan "${XDG_DATA_HOME:-$HOME/.local/share}/vulkan"; do
        compgen -G "$folder/$1/$2" >/dev/null && return 0
    done
    return 1
}

have_layer() {
    have_json explicit_layer.d '*khronos_validation*' || [ -n "${VK_LAYER_PATH:-}${VULKAN_SDK:-}" ]
}

have_driver() {
    have_json icd.d '*.json' || [ -n "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ]
}

check_cargo() {
    command -v cargo >/dev/null && return
    if [ -x "$HOME/.cargo/bin/cargo" ]; then
        fail "cargo is in ~/.cargo/bin, which is not in PATH; run '. ~/.cargo/env' and try again"
    fi
    fail "cargo is missing; install Rust 1.88 or newer, for example by https://rustup.rs"
}

# The folder of the distribution's static libraries (multiarch on Debian).
library_folder() {
    local triple
    triple=$(gcc -print-multiarch 2>/dev/null || true)
    if [ -n "$triple" ] && [ -d "/usr/lib/$triple" ]; then
        echo "/usr/lib/$triple"
    else
        echo /usr/lib
    fi
}

# Archives without which nothing links, and those that only some versions of glslang and SPIRV-Tools have.
essential="shaderc_combined glslang SPIRV-Tools-opt SPIRV-Tools"
optional="MachineIndependent GenericCodeGen OSDependent OGLCompiler SPIRV SPVRemapper HLSL"

missing_archives() {
    local name folder
    folder=$(library_folder)
    for name in $essential; do
        [ -e "$folder/lib$name.a" ] || echo "lib$name.a"
    done
}

# A shaderc that the user has chosen, or one that was merged already, is taken as it is.
have_shaderc() {
    [ -n "${SHADERC_LIB_DIR:-}" ] && compgen -G "${SHADERC_LIB_DIR}/libshaderc*" >/dev/null && return
    [ -e "$archive" ]
}

install_debian() {
    local wanted=() sudo=() missing
    have_library libvulkan.so.1 || wanted+=(libvulkan1)
    have_driver || wanted+=(mesa-vulkan-drivers)
    have_layer || wanted+=(vulkan-validationlayers)
    command -v c++ >/dev/null || wanted+=(g++)
    command -v ar >/dev/null || wanted+=(binutils)
    if ! have_shaderc && [ -n "$(missing_archives)" ]; then
        wanted+=(libshaderc-dev glslang-dev spirv-tools)
    elif ! command -v spirv-val >/dev/null; then
        wanted+=(spirv-tools)
    fi
    [ ${#wanted[@]} -eq 0 ] && return

    if [ "$(id -u)" -ne 0 ]; then
        command -v sudo >/dev/null || fail "as root, run: apt-get install --no-install-recommends ${wanted[*]}"
        sudo=(sudo)
    fi
    say "installing ${wanted[*]}"
    "${sudo[@]}" apt-get update -qq >&2 || say "apt-get update failed; trying with the lists that are there"
    # Newer releases keep the SPIRV-Tools archives in a package of their own.
    local extra
    for extra in spirv-tools-dev libspirv-tools-dev; do
        if [[ " ${wanted[*]} " == *" libshaderc-dev "* ]] && apt-cache show "$extra" >/dev/null 2>&1; then
            wanted+=("$extra")
        fi
    done
    "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends \
        -o Dpkg::Use-Pty=0 "${wanted[@]}" >&2 || fail "apt-get could not install ${wanted[*]}"

    if ! have_shaderc; then
        missing=$(missing_archives)
        [ -z "$missing" ] || fail "the packages of this release do not hold $(echo "$missing" | tr '\n' ' ')in" \
            "$(library_folder); install the Vulkan SDK and set SHADERC_LIB_DIR to its lib folder"
    fi
}

# Debian's libshaderc_combined.a lacks the objects of glslang and SPIRV-Tools: one archive is made of them all.
merge_archives() {
    local folder name script newest
    folder=$(library_folder)
    mkdir -p "$target"
    newest=$archive
    for name in $essential $optional; do
        [ "$folder/lib$name.a" -nt "$newest" ] && newest="$folder/lib$name.a"
    done
    [ -e "$archive" ] && [ "$newest" = "$archive" ] && return
    [ -z "$(missing_archives)" ] || return 0 # an archive from before, without the packages that it was made of

    script="create $archive.new"$'\n'
    for name in $essential $optional; do
        [ -e "$folder/lib$name.a" ] && script+="addlib $folder/lib$name.a"$'\n'
    done
    script+=$'save\nend\n'
    rm -f "$archive.new"
    ar -M <<<"$script"
    check_links "$archive.new"
    mv "$archive.new" "$archive"
    say "merged shaderc's archives into ${archive#"$root"/}"
}

# Compiles a shader with the merged archive, so that a hole in it is found here and not at the end of a build.
check_links() {
    local scratch
    scratch=$(mktemp -d)
    cat >"$scratch/check.c" <<'C'
#include <stddef.h>
/* Declared here so that no header is needed; see shaderc.h. */
void *shaderc_compiler_initialize(void);
void *shaderc_compile_into_spv(void *, const char *, size_t, int, const char *, const char *, void *);
int shaderc_result_get_compilation_status(void *);
int main(void) {
    const char source[] = "#version 450\nlayout(local_size_x = 1) in; void main() {}";
    void *compiler = shaderc_compiler_initialize();
    return shaderc_result_get_compilation_status(
        shaderc_compile_into_spv(compiler, source, sizeof source - 1, 2 /* compute */, "check", "main", NULL));
}
C
    cp "$1" "$scratch/libcheck.a"
    if ! { cc -c "$scratch/check.c" -o "$scratch/check.o" &&
        c++ "$scratch/check.o" -L"$scratch" -lcheck -lpthread -o "$scratch/check" && "$scratch/check"; }; then
        rm -rf "$scratch" "$1"
        fail "the shaderc archives of this release do not link together; install the Vulkan SDK and set" \
            "SHADERC_LIB_DIR to its lib folder"
    fi
    rm -rf "$scratch"
}

# Elsewhere: use what pkg-config finds, and name what is missing.
check_elsewhere() {
    local missing=() folder
    have_library libvulkan.so.1 || missing+=("the Vulkan loader (libvulkan.so.1)")
    have_driver || missing+=("a Vulkan driver (Mesa's lavapipe runs without a GPU)")
    have_layer || missing+=("the Khronos validation layer")
    command -v c++ >/dev/null || missing+=("a C++ compiler")
    command -v spirv-val >/dev/null || missing+=("SPIRV-Tools (spirv-val)")
    if ! have_shaderc; then
        if folder=$(pkg-config --variable=libdir shaderc 2>/dev/null) && [ -n "$folder" ]; then
            mkdir -p "$target"
            ln -sf "$folder"/libshaderc*.so "$target/"
        elif [ -z "${VULKAN_SDK:-}" ]; then
            missing+=("shaderc with its development files, or SHADERC_LIB_DIR set to the folder of its library")
        fi
    fi
    [ ${#missing[@]} -eq 0 ] && return
    say "this is not Debian or Ubuntu; please install:"
    printf '  - %s\n' "${missing[@]}" >&2
    exit 1
}

check_cargo
if [ -e /etc/debian_version ] && command -v apt-get >/dev/null; then
    install_debian
    [ -n "${SHADERC_LIB_DIR:-}" ] || merge_archives
else
    check_elsewhere
fi
