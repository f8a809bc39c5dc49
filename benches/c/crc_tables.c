/* CRC-16/MODBUS by tables in C, 1, 4, 8 and 16 bytes at once: the yardstick for crates/rtu/src/crc.rs.
 *
 * Prints, for each number of bytes, the nanoseconds of each method: medians of 31 runs, as JSON.
 */
#include <string.h>

#include "timed.h"

enum { RUNS = 31, MOST = 65536 };

static uint16_t table[16][256];

static void make_tables(void) {
    for (int byte = 0; byte < 256; byte++) {
        uint16_t crc = (uint16_t)byte;
        for (int following = 0; following < 16; following++) {
            for (int bit = 0; bit < 8; bit++) crc = crc & 1 ? (uint16_t)(crc >> 1 ^ 0xA001) : (uint16_t)(crc >> 1);
            table[following][byte] = crc;
        }
    }
}

static uint16_t rest(uint16_t crc, const uint8_t *p, size_t n) {
    while (n--) crc = (uint16_t)(crc >> 8 ^ table[0][(crc ^ *p++) & 0xFF]);
    return crc;
}

static uint16_t by_1(const uint8_t *p, size_t n) { return rest(0xFFFF, p, n); }

static uint16_t by_4(const uint8_t *p, size_t n) {
    uint16_t crc = 0xFFFF;
    for (; n >= 4; n -= 4, p += 4)
        crc = table[3][p[0] ^ (crc & 0xFF)] ^ table[2][p[1] ^ crc >> 8] ^ table[1][p[2]] ^ table[0][p[3]];
    return rest(crc, p, n);
}

static uint16_t eight(uint16_t crc, const uint8_t *p) {
    return table[7][p[0] ^ (crc & 0xFF)] ^ table[6][p[1] ^ crc >> 8] ^ table[5][p[2]] ^ table[4][p[3]] ^ table[3][p[4]] ^
           table[2][p[5]] ^ table[1][p[6]] ^ table[0][p[7]];
}

static uint16_t by_8(const uint8_t *p, size_t n) {
    uint16_t crc = 0xFFFF;
    for (; n >= 8; n -= 8, p += 8) crc = eight(crc, p);
    return rest(crc, p, n);
}

static uint16_t by_16(const uint8_t *p, size_t n) {
    uint16_t crc = 0xFFFF;
    for (; n >= 16; n -= 16, p += 16)
        crc = table[15][p[0] ^ (crc & 0xFF)] ^ table[14][p[1] ^ crc >> 8] ^ table[13][p[2]] ^ table[12][p[3]] ^
              table[11][p[4]] ^ table[10][p[5]] ^ table[9][p[6]] ^ table[8][p[7]] ^ eight(0, p + 8);
    for (; n >= 8; n -= 8, p += 8) crc = eight(crc, p);
    return rest(crc, p, n);
}

int main(void) {
    static const size_t sizes[] = {6, 8, 11, 37, 256, MOST};
    static const struct {
        const char *name;
        uint16_t (*crc)(const uint8_t *, size_t);
    } methods[] = {{"C, 1 table", by_1}, {"C, 4 tables", by_4}, {"C, 8 tables", by_8}, {"C, 16 tables", by_16}};
    static uint8_t data[MOST];
    volatile uint16_t sink;
    make_tables();
    for (uint32_t n = 0; n < MOST; n++) data[n] = (uint8_t)(n * 0x9E3779B9u >> 24);
    for (size_t m = 0; m < sizeof methods / sizeof *methods; m++)
        if (methods[m].crc((const uint8_t *)"123456789", 9) != 0x4B37) return fprintf(stderr, "%s\n", methods[m].name), 1;
    printf("{");
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++) {
        printf("%s\"%zu\": {", s ? ", " : "", sizes[s]);
        for (size_t m = 0; m < sizeof methods / sizeof *methods; m++) {
            int64_t took[RUNS];
            long calls = (long)(2000000 / (sizes[s] + 20)) + 1;
            for (int run = 0; run < RUNS; run++) {
                int64_t start = now();
                for (long call = 0; call < calls; call++) {
                    __asm__ volatile("" : : "r"(data) : "memory"); /* as if the data were new */
                    sink = methods[m].crc(data, sizes[s]);
                }
                took[run] = now() - start;
            }
            qsort(took, RUNS, sizeof *took, by_size);
            printf("%s\"%s\": %.3f", m ? ", " : "", methods[m].name, (double)took[RUNS / 2] / (double)calls);
        }
        printf("}");
    }
    printf("}\n");
    (void)sink;
    return 0;
}
