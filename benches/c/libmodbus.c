/* libmodbus from C, without its headers: loaded by path, so that nothing need be installed.
 *
 * usage: libmodbus LIBRARY PORT BAUD ADDRESS WORDS WARM CYCLES LIMIT_S
 */
#include <dlfcn.h>

#include "timed.h"

static void *context;
static int (*read_registers)(void *, int, int, uint16_t *);
static int address, words;

static int cycle(void) {
    uint16_t into[125];
    return read_registers(context, address, words, into) != words;
}

int main(int count, char **given) {
    if (count != 9) return fprintf(stderr, "see the comment in libmodbus.c\n"), 2;
    void *library = dlopen(given[1], RTLD_NOW);
    if (library == NULL) return fprintf(stderr, "%s\n", dlerror()), 1;
    void *(*make)(const char *, int, char, int, int) =
        (void *(*)(const char *, int, char, int, int))dlsym(library, "modbus_new_rtu");
    int (*set_slave)(void *, int) = (int (*)(void *, int))dlsym(library, "modbus_set_slave");
    int (*connect)(void *) = (int (*)(void *))dlsym(library, "modbus_connect");
    read_registers = (int (*)(void *, int, int, uint16_t *))dlsym(library, "modbus_read_registers");
    if (!make || !set_slave || !connect || !read_registers) return fprintf(stderr, "no libmodbus\n"), 1;
    address = atoi(given[4]);
    words = atoi(given[5]);
    context = make(given[2], atoi(given[3]), 'N', 8, 2);
    if (context == NULL || set_slave(context, 1) != 0 || connect(context) != 0) return perror(given[2]), 1;
    return timed_run(cycle, atol(given[6]), atol(given[7]), 1000000000 * atoll(given[8]));
}
