#!/bin/sh
# Builds modbus-relay of crates.io into .tools/modbus-relay, which `make conformance` puts beside drivebus's gateway.
#
# Some minutes, once. Needs no root: the file of libudev that its build asks for is downloaded from Debian and unpacked,
# not installed. Where it cannot be had this says why and succeeds, and the page is made without it.
set -u
cd "$(dirname "$0")/.." || exit 1
version=2025.11.0
place=$PWD/.tools/modbus-relay
cargo=${CARGO:-cargo}

[ ! -x "$place/bin/modbus-relay" ] || [ ! -e "$place/flush_input.so" ] || exit 0
without() {
    echo "modbus-relay is not to be had here ($1); the page says so." >&2
    exit 0
}

mkdir -p "$place/parts" || without "$place cannot be written"
if ! pkg-config --exists libudev 2>/dev/null; then
    command -v apt-get >/dev/null 2>&1 && command -v dpkg >/dev/null 2>&1 || without "libudev-dev is missing"
    (cd "$place/parts" && apt-get -q -o APT::Sandbox::User=root download libudev-dev && dpkg -x ./libudev-dev_*.deb .) ||
        without "libudev-dev could not be downloaded"
    described=$(find "$place/parts" -name libudev.pc | head -n 1)
    library=$(find /lib /usr/lib -name libudev.so.1 2>/dev/null | head -n 1)
    [ -n "$described" ] && [ -n "$library" ] || without "libudev is missing"
    ln -sf "$library" "$place/parts/libudev.so"
    PKG_CONFIG_PATH=$(dirname "$described")
    export PKG_CONFIG_PATH
    export RUSTFLAGS="${RUSTFLAGS:-} -L native=$place/parts"
fi
# What a pseudo-terminal would otherwise do to it.
${CC:-cc} -shared -fPIC -O1 -o "$place/flush_input.so" tests/conformance/gateways/flush_input.c ||
    without "there is no C compiler"
$cargo install --quiet --locked --version "$version" --root "$place" modbus-relay || without "it could not be built"
