/* CRC-16/MODBUS for the bare master and slave: one table, one byte at a time. */
#ifndef CRC_H
#define CRC_H

#include <stddef.h>
#include <stdint.h>

static uint16_t crc_table[256];

static inline void crc_make_table(void) {
    for (int byte = 0; byte < 256; byte++) {
        uint16_t crc = (uint16_t)byte;
        for (int bit = 0; bit < 8; bit++) crc = crc & 1 ? (uint16_t)(crc >> 1 ^ 0xA001) : (uint16_t)(crc >> 1);
        crc_table[byte] = crc;
    }
}

static inline uint16_t crc16(const uint8_t *data, size_t length) {
    uint16_t crc = 0xFFFF;
    while (length--) crc = (uint16_t)(crc >> 8 ^ crc_table[(crc ^ *data++) & 0xFF]);
    return crc;
}

#endif
