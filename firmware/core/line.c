#include "line.h"

#include "hal.h"

#define PAUSE_US 100000
#define COMPLAINTS 10u
#define SECOND_US 1000000

static bool ever_wrote;
static int64_t wrote_us;

/* When the last complaints were made, the oldest at `complaint_at`. */
static int64_t complaint_us[COMPLAINTS];
static uint8_t complaint_count;
static uint8_t complaint_at;

void line_put(const uint8_t *wire, uint16_t size, int64_t now_us)
{
    static const uint8_t delimiter = 0;
    if (hal_serial_room() < size + 1u) {
        return;
    }
    if (!ever_wrote || now_us - wrote_us > PAUSE_US) {
        hal_serial_write(&delimiter, 1);
    }
    hal_serial_write(wire, size);
    ever_wrote = true;
    wrote_us = now_us;
}

bool line_may_complain(int64_t now_us)
{
    if (complaint_count == COMPLAINTS) {
        int64_t since_us = now_us - complaint_us[complaint_at];
        if (since_us >= 0 && since_us < SECOND_US) {
            return false;
        }
    } else {
        complaint_count++;
    }
    complaint_us[complaint_at] = now_us;
    complaint_at = (uint8_t)((complaint_at + 1u) % COMPLAINTS);
    return true;
}
