#include "convert.h"

#include "hal.h"
#include "rtd_table.h"

#define CODES 1024u
#define RTD_NO_VALUE (-32767 - 1)
#define RTD_OPEN_CC 32767
#define RTD_SHORT_CC (-24200)
#define RTD_FULL 0x7FFFu /* whatever the fault bit says: an open sensor may set it too */
#define PULSE_RPM_US 30000000u
#define RPM_MOST 65535u

uint16_t convert_analog(uint16_t code, uint16_t full)
{
    return (uint16_t)(((uint32_t)code * full + CODES / 2u) / CODES);
}

/* A straight line between two entries of the table is within half a cC of the platinum curve. */
int16_t convert_rtd(uint16_t rtd_register)
{
    uint16_t code = rtd_register >> 1;
    uint16_t index = code / RTD_TABLE_STEP;
    uint16_t part = code % RTD_TABLE_STEP;
    int16_t low;
    uint16_t rise;
    if (code == RTD_FULL) {
        return RTD_OPEN_CC;
    }
    if ((rtd_register & 1u) != 0) {
        return RTD_NO_VALUE;
    }
    if (code == 0) {
        return RTD_SHORT_CC;
    }
    if (index >= RTD_TABLE_SIZE - 1u) {
        return RTD_OPEN_CC;
    }
    low = rtd_table_cC[index];
    rise = (uint16_t)(rtd_table_cC[index + 1u] - low);
    return (int16_t)(low + (int16_t)(((uint32_t)rise * part + RTD_TABLE_STEP / 2u)
                                     / RTD_TABLE_STEP));
}

uint16_t convert_tacho(uint32_t period_us)
{
    uint32_t rpm;
    if (period_us == 0) {
        return 0;
    }
#ifdef __AVR__
    /* The half fits 24 bits, and a chip without a divider is done in half the time. */
    if ((period_us >> 24) == 0 && period_us > 1u) {
        rpm = (__uint24)(PULSE_RPM_US / 2u) / (__uint24)(period_us / 2u);
        return (uint16_t)(rpm > RPM_MOST ? RPM_MOST : rpm);
    }
#endif
    rpm = PULSE_RPM_US / 2u / (period_us > 1u ? period_us / 2u : 1u);
    return (uint16_t)(rpm > RPM_MOST ? RPM_MOST : rpm);
}

bool convert_bridge_valid(int32_t code)
{
    return code > BRIDGE_LEAST && code < BRIDGE_MOST;
}
