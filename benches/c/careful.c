/* A careful master in C: the yardstick for drivebus on a line that loses characters.
 *
 * Reads the same words again and again. Keeps the silence, drops what came before the request, waits PAUSE_MS for an answer
 * and between its parts, checks length, unit, function and CRC, and asks up to RETRIES times more. Knows nothing of late
 * answers: on this line there are none.
 *
 * usage: careful PORT SILENCE_NS ADDRESS WORDS PAUSE_MS RETRIES SECONDS
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

enum { UNIT = 1, READ = 3, REQUEST = 8 };

static int port, pause_ms;
static int64_t silence, quiet; /* nanoseconds; the line is free from `quiet` on */
static uint8_t request[REQUEST];
static size_t expected;

static void sleep_until(int64_t moment) {
    struct timespec t = {moment / 1000000000, moment % 1000000000};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) == EINTR) {}
}

/* 0 for a right answer, 1 for none. */
static int ask(void) {
    uint8_t answer[256];
    size_t have = 0;
    sleep_until(quiet);
    tcflush(port, TCIFLUSH);
    if (write(port, request, REQUEST) != REQUEST) return 1;
    quiet = now() + silence;
    while (have < expected) {
        struct pollfd readable = {port, POLLIN, 0};
        if (poll(&readable, 1, pause_ms) != 1) return 1;
        ssize_t count = read(port, answer + have, sizeof answer - have);
        if (count <= 0) return 1;
        have += (size_t)count;
        quiet = now() + silence;
    }
    uint16_t crc = crc16(answer, expected - 2);
    return !(have == expected && answer[0] == UNIT && answer[1] == READ && answer[2] == expected - 5 &&
             answer[expected - 2] == (crc & 0xFF) && answer[expected - 1] == crc >> 8);
}

int main(int count, char **given) {
    if (count != 8) return fprintf(stderr, "see the comment in careful.c\n"), 2;
    silence = atoll(given[2]);
    unsigned address = (unsigned)atoi(given[3]), words = (unsigned)atoi(given[4]);
    pause_ms = atoi(given[5]);
    int retries = atoi(given[6]);
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
    prctl(PR_SET_TIMERSLACK, 1UL);
    long right = 0, calls = 0;
    int64_t start = now(), end = start + 1000000000 * atoll(given[7]);
    quiet = start + silence;
    while (now() < end) {
        int failed = 1;
        for (int tried = 0; failed && tried <= retries; tried++) failed = ask();
        right += !failed;
        calls++;
    }
    printf("{\"calls\": %ld, \"right\": %ld, \"seconds\": %.6f}\n", calls, right, 1e-9 * (double)(now() - start));
    return 0;
}
