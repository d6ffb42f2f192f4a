#include "reports.h"

#define KEPT 16u
#define REPEATS 2u

static uint8_t kept[KEPT][SMAD_FAULT_REPORT_SIZE];
static uint8_t repeats_left[KEPT];
static uint16_t count;
static uint8_t first_fault;
static uint8_t repeat_at;

/* Place of a report: the first one stays, the others take turns. */
static uint8_t slot_of(uint8_t index)
{
    return index == 0 ? 0 : (uint8_t)(1u + (index - 1u) % (KEPT - 1u));
}

const uint8_t *reports_add(struct smad_fault_report *report)
{
    uint8_t slot;
    report->index = (uint8_t)(count < 255u ? count : 255u);
    if (count < UINT16_MAX) {
        count++;
    }
    slot = slot_of(report->index);
    smad_pack_fault_report(report, kept[slot]);
    repeats_left[slot] = REPEATS;
    if (first_fault == 0) {
        first_fault = report->fault;
    }
    return kept[slot];
}

const uint8_t *reports_repeat(void)
{
    while (repeat_at < KEPT) {
        uint8_t slot = repeat_at++;
        if (repeats_left[slot] > 0) {
            repeats_left[slot]--;
            return kept[slot];
        }
    }
    repeat_at = 0;
    return NULL;
}

const uint8_t *reports_get(uint8_t index)
{
    const uint8_t *report = kept[slot_of(index)];
    return index < count && report[1] == index ? report : NULL;
}

uint16_t reports_count(void)
{
    return count;
}

uint8_t reports_first_fault(void)
{
    return first_fault;
}
