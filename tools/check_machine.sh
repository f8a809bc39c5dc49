#!/bin/sh
# Names what this machine lacks before anything is built, and how to get it. Prints nothing when all is there.
#
# usage: check_machine.sh PYTHON [rust [c++]]
set -u
python=$1
missing=0

lacks() { # what, Debian, macOS
    missing=1
    printf 'missing: %s\n    Debian, Ubuntu:  %s\n    macOS:           %s\n' "$1" "$2" "$3" >&2
}

if ! "$python" -c 'import sys; sys.exit(sys.version_info < (3, 10))' 2>/dev/null; then
    lacks "Python 3.10 or newer as '$python' (or: make PYTHON=/path/to/python3 …)" \
        "apt-get install python3 python3-venv" "brew install python"
elif ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
    lacks "Python's venv module" "apt-get install python3-venv" "brew install python"
fi

if [ "${2:-}" = rust ]; then
    need=$(sed -n 's/^rust-version *= *"\(.*\)"/\1/p' Cargo.toml)
    rustup="install rustup from your distribution or rustup.rs, then: rustup toolchain install stable"
    for tool in cargo rustc; do
        have=$("$tool" --version 2>/dev/null | awk '{print $2}')
        if [ -z "$have" ]; then
            lacks "$tool $need or newer" "$rustup" "$rustup"
        elif [ "$(printf '%s\n%s\n' "$need" "$have" | sort -V | head -n 1)" != "$need" ]; then
            lacks "$tool $need or newer (this one is $have)" "rustup update stable" "rustup update stable"
        fi
    done
    # On Windows, Rust finds its linker where no path leads.
    command -v cc >/dev/null 2>&1 || [ "${OS:-}" = Windows_NT ] ||
        lacks "a C compiler (Rust links with it)" "apt-get install build-essential" "xcode-select --install"
fi

if [ "${3:-}" = c++ ]; then
    command -v c++ >/dev/null 2>&1 ||
        lacks "a C++ compiler (libFuzzer is built with it)" "apt-get install build-essential" "xcode-select --install"
fi
exit $missing
