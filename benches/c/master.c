/* The least a master can do: the yardstick for drivebus on the same line.
 *
 * Keeps the silence from the last byte it read, writes the request in one piece, sleeps until the answer can be complete,
 * then polls and reads until it is, and checks length, unit, function and CRC. Nothing else: no retries, no late answers,
 * no noise, one thread, one caller.
 *
 * usage: master PORT CHARACTER_NS SILENCE_NS ADDRESS WORDS WARM CYCLES LIMIT_S     (unpaced: 0 ns for both)
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <string.h>
#include <sys/prctl.h>
#include <termios.h>
#include <unistd.h>

#include "crc.h"
#include "timed.h"

enum { UNIT = 1, READ = 3, REQUEST = 8, TIMEOUT_MS = 1000 };

static int port;
static int64_t character, silence, quiet; /* nanoseconds; the line is free from `quiet` on */
static uint8_t request[REQUEST];
static size_t expected;

static void sleep_until(int64_t moment) {
    struct timespec t = {moment / 1000000000, moment % 1000000000};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) == EINTR) {}
}

static int cycle(void) {
    uint8_t answer[256];
    size_t have = 0;
    if (silence > 0) sleep_until(quiet);
    if (write(port, request, REQUEST) != REQUEST) return 1;
    if (character > 0) sleep_until(now() + silence + character * (int64_t)(REQUEST + expected));
    while (have < expected) {
        struct pollfd readable = {port, POLLIN, 0};
        if (poll(&readable, 1, TIMEOUT_MS) != 1) return 1;
        ssize_t count = read(port, answer + have, sizeof answer - have);
        if (count <= 0) return 1;
        have += (size_t)count;
    }
    quiet = now() + silence;
    uint16_t crc = crc16(answer, expected - 2);
    return !(have == expected && answer[0] == UNIT && answer[1] == READ && answer[2] == expected - 5 &&
             answer[expected - 2] == (crc & 0xFF) && answer[expected - 1] == crc >> 8);
}

int main(int count, char **given) {
    if (count != 9) return fprintf(stderr, "see the comment in master.c\n"), 2;
    character = atoll(given[2]);
    silence = atoll(given[3]);
    unsigned address = (unsigned)atoi(given[4]), words = (unsigned)atoi(given[5]);
    expected = 5 + 2 * words;
    crc_make_table();
    uint8_t body[] = {UNIT, READ, (uint8_t)(address >> 8), (uint8_t)address, (uint8_t)(words >> 8), (uint8_t)words};
    uint16_t crc = crc16(body, sizeof body);
    memcpy(request, body, sizeof body);
    request[6] = (uint8_t)crc;
    request[7] = (uint8_t)(crc >> 8);

    struct termios raw;
    port = open(given[1], O_RDWR | O_NOCTTY);
    if (port < 0 || tcgetattr(port, &raw) != 0) return perror(given[1]), 1;
    cfmakeraw(&raw);
    if (tcsetattr(port, TCSANOW, &raw) != 0 || tcflush(port, TCIOFLUSH) != 0) return perror(given[1]), 1;
    prctl(PR_SET_TIMERSLACK, 1UL); /* without it Linux adds up to 50 us to every sleep */
    quiet = now() + silence;
    return timed_run(cycle, atol(given[6]), atol(given[7]), 1000000000 * atoll(given[8]));
}
