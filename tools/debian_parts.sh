#!/bin/sh
# Brings mbpoll, libmodbus and LinuxCNC's HAL, which the interop tests talk to, tshark, which reads captures, valgrind,
# which counts instructions, strace, which writes down system calls, PostgreSQL and Mosquitto,
# which samples are delivered to, Prometheus, which scrapes metrics, and Chromium, which opens the page, into .tools/
# without touching the system.
#
# Needs no root: packages are downloaded and unpacked, not installed. Where apt is not there it says what is missing,
# and the checks that need it are skipped (with CI=true they fail).
set -u
cd "$(dirname "$0")/.." || exit 1
tools=$PWD/.tools

have_program() { command -v mbpoll >/dev/null 2>&1 || [ -x "$tools/usr/bin/mbpoll" ]; }
have_library() {
    ldconfig -p 2>/dev/null | grep -q 'libmodbus\.so\.5' || ls "$tools"/usr/lib/*/libmodbus.so.5 >/dev/null 2>&1
}
# Nothing is counted on other systems.
have_valgrind() {
    [ "$(uname -sm)" != "Linux x86_64" ] || command -v valgrind >/dev/null 2>&1 ||
        [ -x "$tools/usr/libexec/valgrind/callgrind-amd64-linux" ]
}
# Linux's alone.
have_strace() {
    [ "$(uname -s)" != Linux ] || command -v strace >/dev/null 2>&1 || [ -x "$tools/usr/bin/strace" ]
}
have_tshark() { command -v tshark >/dev/null 2>&1 || [ -x "$tools/usr/bin/tshark" ]; }
# LinuxCNC is for Linux alone.
have_hal() {
    [ "$(uname -s)" != Linux ] || command -v halrun >/dev/null 2>&1 || [ -x "$tools/linuxcnc/usr/bin/mb2hal" ]
}
have_prometheus() { command -v promtool >/dev/null 2>&1 || [ -x "$tools/usr/bin/promtool" ]; }
# Debian has the server's programs beside the path, in a folder for each version.
have_postgres() {
    command -v initdb >/dev/null 2>&1 || ls /usr/lib/postgresql/*/bin/initdb >/dev/null 2>&1 ||
        ls "$tools"/usr/lib/postgresql/*/bin/initdb >/dev/null 2>&1
}
have_chromium() {
    command -v chromium-headless-shell >/dev/null 2>&1 || command -v chromium >/dev/null 2>&1 ||
        command -v chromium-browser >/dev/null 2>&1 || command -v google-chrome >/dev/null 2>&1 ||
        [ -x "$tools/usr/lib/chromium/chromium-headless-shell" ]
}
# Debian has it where only root looks for programs.
have_mosquitto() {
    command -v mosquitto >/dev/null 2>&1 || [ -x /usr/sbin/mosquitto ] || [ -x "$tools/usr/sbin/mosquitto" ]
}
have_all() {
    have_program && have_library && have_valgrind && have_strace && have_tshark && have_postgres &&
        have_mosquitto && have_prometheus && have_chromium && have_hal
}
lacking() {
    echo "of mbpoll, libmodbus, tshark, valgrind, strace, PostgreSQL, Mosquitto, Prometheus, Chromium and LinuxCNC some are missing ($1); the checks" >&2
    echo "that need them will be skipped." >&2
    echo "    Debian, Ubuntu:  apt-get install mbpoll libmodbus5 tshark valgrind strace postgresql mosquitto prometheus chromium-headless-shell linuxcnc-uspace" >&2
    echo "    macOS:           brew install libmodbus wireshark postgresql mosquitto prometheus chromium, and mbpoll from its source" >&2
    exit 0
}

have_all && exit 0
packages=
have_program && have_library || packages="mbpoll libmodbus5"
have_valgrind || packages="$packages valgrind"
have_strace || packages="$packages strace libunwind8"
have_prometheus || packages="$packages prometheus"
large=
have_tshark || large=tshark
have_postgres || large="$large postgresql"
have_mosquitto || large="$large mosquitto"
have_chromium || large="$large chromium-headless-shell"
command -v apt-get >/dev/null 2>&1 && command -v dpkg >/dev/null 2>&1 || lacking "no apt here"

mkdir -p "$tools/apt/lists/partial" "$tools/apt/cache/archives/partial" "$tools/apt/debs"
cd "$tools/apt/debs" || exit 1
# apt drops root for a user who cannot write here.
as_is="-q -o APT::Sandbox::User=root -o Acquire::Retries=5"
# Where the system's package lists are empty or old: lists of our own.
own="$as_is -o Dir::State::lists=$tools/apt/lists -o Dir::Cache=$tools/apt/cache"
# tshark, PostgreSQL, Mosquitto and Chromium need libraries of their own: those that apt would install with them here.
with_libraries() { apt-get -s install --no-install-recommends "$@" 2>/dev/null | awk '/^Inst/ { print $2 }'; }
# shellcheck disable=SC2086  # options, to be split
for package in $large; do
    found=$(with_libraries $as_is "$package")
    [ -n "$found" ] || { apt-get $own update >/dev/null && found=$(with_libraries $own "$package"); }
    packages="$packages $found"
done
wants_hal=
have_hal || wants_hal=linuxcnc-uspace
# halcmd reads its lines by libedit, which not every system has.
[ -z "$wants_hal" ] || ldconfig -p 2>/dev/null | grep -q 'libedit\.so\.2' || packages="$packages libedit2 libbsd0 libmd0"
# shellcheck disable=SC2086  # options, to be split
fetch() { apt-get $as_is download "$@" || { apt-get $own update && apt-get $own download "$@"; }; }
# shellcheck disable=SC2086  # names, to be split
[ -z "$packages" ] || fetch $packages || lacking "apt-get could not download them"
# What of LinuxCNC runs without its screens, a twentieth of it, beside the rest. Its scripts have folders written into
# them and are told where they are; nothing here needs root, so its program is not given it.
unpack_hal() {
    hal=$tools/linuxcnc
    mkdir -p "$hal" && dpkg-deb --fsys-tarfile "$1" | tar -x -C "$hal" --wildcards ./usr/bin/halrun ./usr/bin/halcmd ./usr/bin/rtapi_app \
        './usr/bin/*_vfd' ./usr/bin/mb2hal \
        './usr/lib/liblinuxcnc*' ./usr/lib/linuxcnc/realtime './usr/lib/python3/dist-packages/*hal.*' ./etc/linuxcnc &&
        chmod u-s "$hal/usr/bin/rtapi_app" &&
        sed -i "s|/usr/lib/linuxcnc|$hal&|; s|^PATH=/usr|PATH=$hal/usr|; s|sysconfdir=/etc|sysconfdir=$hal/etc|" \
            "$hal/usr/bin/halrun" "$hal/usr/lib/linuxcnc/realtime" "$hal/etc/linuxcnc/rtapi.conf"
}
# Who cannot have LinuxCNC has the rest all the same.
[ -z "$wants_hal" ] || { fetch "$wants_hal" && unpack_hal ./linuxcnc-uspace_*.deb; }
rm -f ./linuxcnc-uspace_*.deb
for deb in ./*.deb; do
    [ ! -e "$deb" ] || dpkg -x "$deb" "$tools" || lacking "$deb could not be unpacked"
done
have_all || lacking "the packages do not hold them"
