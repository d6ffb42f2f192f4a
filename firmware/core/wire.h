/* Little-endian numbers in bytes, as on the wire. */

#ifndef SMAD_WIRE_H
#define SMAD_WIRE_H

#include <stdint.h>

static inline void wire_put_u16(uint8_t *out, uint16_t value)
{
    out[0] = (uint8_t)value;
    out[1] = (uint8_t)(value >> 8);
}

static inline void wire_put_u32(uint8_t *out, uint32_t value)
{
    wire_put_u16(out, (uint16_t)value);
    wire_put_u16(out + 2, (uint16_t)(value >> 16));
}

static inline uint32_t wire_get_u32(const uint8_t *data)
{
    return (uint32_t)data[0] | (uint32_t)data[1] << 8 | (uint32_t)data[2] << 16
           | (uint32_t)data[3] << 24;
}

#endif
