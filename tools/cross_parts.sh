#!/bin/sh
# Brings what wheels for other systems are built with into .tools/cross/ without touching the system: a Rust compiler with the
# sources of its standard library, MinGW, QEMU, and the Pythons of two other processors.
#
# Needs no root: packages are downloaded and unpacked, not installed. They are those of Debian 12. PyPI has the rest: the
# dependency group `wheels`.
#
#     root/         the compiler, MinGW, QEMU
#     root-arm64/   the compiler's standard library for this processor, and a Python
#     root-armhf/   a Python
set -u
cd "$(dirname "$0")/.." || exit 1
cross=$PWD/.tools/cross
[ ! -e "$cross/.complete" ] || exit 0

lacking() {
    echo "what wheels for other systems are built with is missing: $1" >&2
    exit 1
}
command -v apt-get >/dev/null 2>&1 || lacking "no apt here; this needs Debian 12"
[ "$(dpkg --print-architecture)" = amd64 ] || lacking "this needs a machine of the kind amd64"

# apt for the processor $1, with lists of its own, and what it is to do.
apt() {
    place=$cross/apt-$1
    options="-q -o APT::Sandbox::User=root -o Acquire::Retries=5 -o Acquire::Languages=none -o Dir::State=$place"
    options="$options -o Dir::State::lists=$place/lists -o Dir::Cache=$place/cache"
    # What is installed here is of use to programs of this processor alone.
    if [ "$1" = amd64 ]; then
        options="$options -o Dir::State::status=/var/lib/dpkg/status"
    else
        options="$options -o Dir::State::status=$place/status -o APT::Architecture=$1 -o APT::Architectures=$1"
    fi
    shift
    # shellcheck disable=SC2086  # options, to be split
    (cd "$place/debs" && apt-get $options "$@")
}
# Unpacks to the folder $2 what apt would install here, on a processor $1, with the packages that follow.
unpack() {
    processor=$1 folder=$2
    shift 2
    mkdir -p "$folder" "$cross/apt-$processor/lists/partial" "$cross/apt-$processor/cache/archives/partial" \
        "$cross/apt-$processor/debs"
    : >"$cross/apt-$processor/status"
    # Where a list cannot be had, what is missing shows below.
    apt "$processor" update >/dev/null 2>&1
    needed=$(apt "$processor" -s install --no-install-recommends "$@" | awk '/^Inst/ { print $2 }')
    # What was asked for is downloaded also where the system has it.
    # shellcheck disable=SC2086  # names, to be split
    packages=$(printf '%s\n' "$@" $needed | sort -u)
    # shellcheck disable=SC2086  # names, to be split
    apt "$processor" download $packages >/dev/null || lacking "apt-get could not download $*"
    for deb in "$cross/apt-$processor/debs"/*.deb; do
        dpkg -x "$deb" "$folder" || lacking "$deb could not be unpacked"
    done
    rm -f "$cross/apt-$processor/debs"/*.deb
}

# The newest compiler of Debian 12, beside its first one. It comes with the sources of its standard library, so that this can
# be built for what Debian has no package of.
unpack amd64 "$cross/root" rustc-web cargo-web rust-web-src gcc-mingw-w64-x86-64-win32 qemu-user-static
unpack arm64 "$cross/root-arm64" libstd-rust-web-dev python3-minimal libpython3-stdlib
unpack armhf "$cross/root-armhf" python3-minimal libpython3-stdlib

root=$cross/root/usr
[ -x "$root/bin/rustc" ] && [ -x "$root/bin/cargo" ] || lacking "the packages hold no compiler"
export LD_LIBRARY_PATH="$root/lib/x86_64-linux-gnu"
# The compiler looks for each standard library beside its own. One of another version is none.
ln -sfn "$cross/root-arm64/usr/lib/rustlib/aarch64-unknown-linux-gnu" "$root/lib/rustlib/aarch64-unknown-linux-gnu"
# Every library for Windows begins and ends with these two, which are built by nobody but Rust's own build.
windows=$root/lib/rustlib/x86_64-pc-windows-gnu/lib
mkdir -p "$windows"
for object in rsbegin rsend; do
    RUSTC_BOOTSTRAP=1 "$root/bin/rustc" --target x86_64-pc-windows-gnu --emit=obj -o "$windows/$object.o" \
        "$root/lib/rustlib/src/rust/library/rtstartup/$object.rs" || lacking "$object.o could not be built"
done
: >"$cross/.complete"
