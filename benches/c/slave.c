/* A slave that answers at once, behind a pseudo-terminal: what is left of a transaction is the master's and the system's.
 *
 * Answers 03H for any address and count (register `a` holds `a`), echoes 06H and 08H, drops everything else.
 * Prints the port's path, then works until its standard input is closed.
 */
#define _GNU_SOURCE
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#include "crc.h"

enum { REQUEST = 8 };

static int good(const uint8_t *frame, size_t length) {
    uint16_t crc = crc16(frame, length - 2);
    return frame[length - 2] == (crc & 0xFF) && frame[length - 1] == crc >> 8;
}

/* The length of the answer to `request`, 0 for none. */
static size_t respond(const uint8_t *request, uint8_t *answer) {
    if (!good(request, REQUEST)) return 0;
    if (request[1] == 6 || request[1] == 8) return memcpy(answer, request, REQUEST), REQUEST;
    unsigned address = request[2] << 8 | request[3], count = request[4] << 8 | request[5];
    if (request[1] != 3 || count == 0 || count > 125) return 0;
    size_t length = 0;
    answer[length++] = request[0];
    answer[length++] = request[1];
    answer[length++] = (uint8_t)(2 * count);
    for (; count > 0; count--, address++) {
        answer[length++] = (uint8_t)(address >> 8);
        answer[length++] = (uint8_t)address;
    }
    uint16_t crc = crc16(answer, length);
    answer[length++] = (uint8_t)crc;
    answer[length++] = (uint8_t)(crc >> 8);
    return length;
}

int main(void) {
    int ours = posix_openpt(O_RDWR | O_NOCTTY);
    if (ours < 0 || grantpt(ours) != 0 || unlockpt(ours) != 0) return perror("pseudo-terminal"), 1;
    /* Held open, so that ours does not hang up between two masters. */
    int theirs = open(ptsname(ours), O_RDWR | O_NOCTTY);
    struct termios raw;
    if (theirs < 0 || tcgetattr(theirs, &raw) != 0) return perror("pseudo-terminal"), 1;
    cfmakeraw(&raw);
    tcsetattr(theirs, TCSANOW, &raw);
    crc_make_table();
    printf("%s\n", ptsname(ours));
    fflush(stdout);

    uint8_t request[512], answer[256];
    size_t have = 0;
    for (;;) {
        struct pollfd sources[] = {{ours, POLLIN, 0}, {STDIN_FILENO, POLLIN, 0}};
        if (poll(sources, 2, -1) < 0 || sources[1].revents != 0) return 0;
        ssize_t count = read(ours, request + have, sizeof request - have);
        if (count <= 0) return 1;
        have += (size_t)count;
        if (have < REQUEST) continue;
        size_t length = have == REQUEST ? respond(request, answer) : 0;
        have = 0; /* whatever was no request is dropped whole */
        if (length > 0 && write(ours, answer, length) != (ssize_t)length) return 1;
    }
}
