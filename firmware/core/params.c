#include "params.h"

#include "hal.h"
#include "wire.h"

#include <string.h>

#define ENTRY 7u
#define HEADER 6u
#define SLOT_MOST (1u + HEADER + ENTRY * SMAD_PARAMETER_COUNT + 4u)
#define MARK 0x5Au
#define ERASED 0xFFu
#define BOOTS_AT 0u
#define BOOTS_SIZE 8u
#define SLOT_0 16u
#define SLOT_1 (SLOT_0 + (HAL_STORE_SIZE - SLOT_0) / 2u)
#define LEAST_SHARE_PERCENT 70u

typedef char slots_fit[SLOT_MOST <= SLOT_1 - SLOT_0 ? 1 : -1];

static const uint16_t RATES_HZ[] = {500, 250, 100};

static int32_t values[SMAD_PARAMETER_COUNT];
static uint32_t values_crc;

/* The write in progress. What was read back wrong is written once more, then it failed. */
static uint8_t image[SLOT_MOST];
static uint16_t image_size;
static uint16_t image_at;
static uint16_t image_slot;
static bool retried;
static bool writing;

static uint32_t newest_sequence;
static uint16_t next_slot;

static void pack_entry(uint8_t *out, uint8_t index)
{
    out[0] = 0;
    wire_put_u16(out + 1, smad_parameters[index].number);
    wire_put_u32(out + 3, (uint32_t)values[index]);
}

static void renew_crc(void)
{
    uint32_t crc = 0;
    for (uint8_t i = 0; i < SMAD_PARAMETER_COUNT; i++) {
        uint8_t entry[ENTRY];
        pack_entry(entry, i);
        crc = smad_crc32_more(crc, entry, sizeof entry);
    }
    values_crc = crc;
}

static int8_t index_of(uint16_t number)
{
    for (uint8_t i = 0; i < SMAD_PARAMETER_COUNT; i++) {
        if (smad_parameters[i].number == number) {
            return (int8_t)i;
        }
    }
    return -1;
}

static void use_initial(void)
{
    for (uint8_t i = 0; i < SMAD_PARAMETER_COUNT; i++) {
        values[i] = smad_parameters[i].initial;
    }
}

int32_t params_get(uint16_t number)
{
    int8_t index = index_of(number);
    return index < 0 ? 0 : values[index];
}

uint32_t params_crc(void)
{
    return values_crc;
}

bool params_describe(uint16_t number, struct smad_param_value *out)
{
    int8_t index = index_of(number);
    if (index < 0) {
        return false;
    }
    out->axis = 0;
    out->param = number;
    out->kind = smad_parameters[index].kind;
    out->value = values[index];
    out->minimum = smad_parameters[index].minimum;
    out->maximum = smad_parameters[index].maximum;
    out->param_crc = values_crc;
    return true;
}

static bool is_choice(int32_t value)
{
    for (uint8_t i = 0; i < sizeof RATES_HZ / sizeof RATES_HZ[0]; i++) {
        if (value == RATES_HZ[i]) {
            return true;
        }
    }
    return false;
}

/* Highest rate that the chip has the time for, and whose STATE frames leave enough of the line
 * free; see firmware_protocol/rates.py. */
static uint16_t most_rate_hz(void)
{
    uint32_t baud = hal_serial_baud();
    for (uint8_t i = 0; i < sizeof RATES_HZ / sizeof RATES_HZ[0]; i++) {
        uint32_t bytes = (uint32_t)RATES_HZ[i] * (SMAD_STATE_SIZE + 10u)
                         + SMAD_PERIODIC_BYTES_PER_S;
        if (hal_most_rate_hz() != 0 && RATES_HZ[i] > hal_most_rate_hz()) {
            continue;
        }
        if (baud == 0 || bytes * 10u <= baud / 100u * LEAST_SHARE_PERCENT) {
            return RATES_HZ[i];
        }
    }
    return 0;
}

static uint8_t check(int8_t index, int32_t value, int32_t *limit)
{
    int32_t low = smad_parameters[index].minimum;
    int32_t high = smad_parameters[index].maximum;
    bool choice = smad_parameters[index].kind == SMAD_PARAMETER_KIND_CHOICE;
    bool zero = value == 0 && smad_parameters[index].never_zero;
    if (value < low || value > high || zero || (choice && !is_choice(value))) {
        *limit = value < low ? low : high;
        return SMAD_ERROR_CODE_OUT_OF_RANGE;
    }
    return 0;
}

uint8_t params_set(uint16_t number, int32_t value, int32_t *limit)
{
    int8_t index = index_of(number);
    uint8_t refused;
    if (number == PARAM_STATE_RATE_HZ && value > (int32_t)most_rate_hz()) {
        *limit = most_rate_hz();
        return SMAD_ERROR_CODE_RATE_TOO_HIGH;
    }
    if (index < 0) {
        *limit = 0;
        return SMAD_ERROR_CODE_UNKNOWN_PARAMETER;
    }
    refused = check(index, value, limit);
    if (refused == 0) {
        values[index] = value;
        renew_crc();
    }
    return refused;
}

void params_tighten(struct smad_sv_limits *limits)
{
    for (uint8_t i = 0; i < SMAD_PARAMETER_COUNT; i++) {
        smad_sv_tighten(limits, smad_parameters[i].number, values[i]);
    }
}

/* The store */

static uint32_t read_u32(uint16_t at)
{
    uint8_t bytes[4];
    for (uint8_t i = 0; i < 4; i++) {
        bytes[i] = hal_store_read((uint16_t)(at + i));
    }
    return wire_get_u32(bytes);
}

static uint16_t read_u16(uint16_t at)
{
    return (uint16_t)(hal_store_read(at) | (uint16_t)hal_store_read((uint16_t)(at + 1u)) << 8);
}

enum slot { SLOT_EMPTY, SLOT_GOOD, SLOT_DAMAGED };

static enum slot judge(uint16_t slot, uint16_t *size)
{
    uint32_t crc = 0;
    uint16_t body = (uint16_t)(slot + 1u);
    uint8_t mark = hal_store_read(slot);
    enum slot otherwise = mark == MARK ? SLOT_DAMAGED : SLOT_EMPTY;
    *size = 0;
    if (mark == ERASED) {
        return SLOT_EMPTY;
    }
    *size = read_u16((uint16_t)(body + 4u));
    if (*size > ENTRY * SMAD_PARAMETER_COUNT || *size % ENTRY != 0) {
        return otherwise;
    }
    for (uint16_t i = 0; i < HEADER + *size; i++) {
        uint8_t byte = hal_store_read((uint16_t)(body + i));
        crc = smad_crc32_more(crc, &byte, 1);
    }
    /* A mark that is damaged itself, or was cut off while it was written, must not hide limits. */
    return crc == read_u32((uint16_t)(body + HEADER + *size)) ? SLOT_GOOD : otherwise;
}

/* Takes over what a slot holds; entries that do not exist or fit any more keep their values. */
static void take_over(uint16_t slot, uint16_t size)
{
    uint16_t begin = (uint16_t)(slot + 1u + HEADER);
    for (uint16_t at = begin; at < begin + size; at = (uint16_t)(at + ENTRY)) {
        int8_t index = index_of(read_u16((uint16_t)(at + 1u)));
        int32_t value = (int32_t)read_u32((uint16_t)(at + 3u));
        int32_t limit;
        bool fits = hal_store_read(at) == 0 && index >= 0 && check(index, value, &limit) == 0;
        bool rate = fits && smad_parameters[index].number == PARAM_STATE_RATE_HZ;
        if (fits && (!rate || value <= (int32_t)most_rate_hz())) {
            values[index] = value;
        }
    }
}

bool params_load(void)
{
    uint16_t size[2];
    enum slot state[2];
    uint32_t sequence[2];
    uint8_t newest;
    bool damaged;
    use_initial();
    state[0] = judge(SLOT_0, &size[0]);
    state[1] = judge(SLOT_1, &size[1]);
    sequence[0] = state[0] == SLOT_GOOD ? read_u32(SLOT_0 + 1u) : 0;
    sequence[1] = state[1] == SLOT_GOOD ? read_u32(SLOT_1 + 1u) : 0;
    newest = sequence[1] > sequence[0] ? 1 : 0;
    newest_sequence = sequence[newest];
    damaged = state[0] == SLOT_DAMAGED || state[1] == SLOT_DAMAGED;
    if (damaged) {
        /* Nobody can tell whether the good slot is the newer one. */
        next_slot = state[0] == SLOT_DAMAGED ? SLOT_0 : SLOT_1;
    } else {
        next_slot = newest == 0 && state[0] == SLOT_GOOD ? SLOT_1 : SLOT_0;
        if (state[newest] == SLOT_GOOD) {
            take_over(newest == 0 ? SLOT_0 : SLOT_1, size[newest]);
        }
    }
    renew_crc();
    return !damaged;
}

static void write_now(uint16_t at, uint8_t value)
{
    while (hal_store_busy()) {
    }
    hal_store_write(at, value);
}

/* Two cells take turns: a cut between their bytes can make the count jump, never go back. */
uint32_t params_count_boot(void)
{
    uint32_t one = read_u32(BOOTS_AT);
    uint32_t two = read_u32(BOOTS_AT + 4u);
    uint16_t older;
    uint32_t boots;
    uint8_t bytes[4];
    one = one == 0xFFFFFFFFu ? 0 : one;
    two = two == 0xFFFFFFFFu ? 0 : two;
    older = one <= two ? BOOTS_AT : BOOTS_AT + 4u;
    boots = (one > two ? one : two) + 1u;
    wire_put_u32(bytes, boots);
    for (uint8_t i = 4; i-- > 0;) {
        if (hal_store_read((uint16_t)(older + i)) != bytes[i]) {
            write_now((uint16_t)(older + i), bytes[i]);
        }
    }
    return boots;
}

/* The mark goes first and comes back last: in between, the slot does not count. */
void params_save(void)
{
    uint8_t *body = image + 1;
    uint16_t size = 0;
    for (uint8_t i = 0; i < SMAD_PARAMETER_COUNT; i++) {
        if (values[i] != smad_parameters[i].initial) {
            pack_entry(body + HEADER + size, i);
            size = (uint16_t)(size + ENTRY);
        }
    }
    wire_put_u32(body, newest_sequence + 1u);
    wire_put_u16(body + 4, size);
    wire_put_u32(body + HEADER + size, smad_crc32(body, HEADER + size));
    image[0] = MARK;
    image_size = (uint16_t)(1u + HEADER + size + 4u);
    image_slot = next_slot;
    image_at = 1;
    retried = false;
    writing = true;
    if (hal_store_read(image_slot) != ERASED) {
        write_now(image_slot, ERASED);
    }
}

bool params_saving(void)
{
    return writing;
}

static bool image_stands(void)
{
    for (uint16_t i = 0; i < image_size; i++) {
        if (hal_store_read((uint16_t)(image_slot + i)) != image[i]) {
            return false;
        }
    }
    return true;
}

/* Writes the next byte that differs. Returns false if none is left. */
static bool write_next(void)
{
    while (image_at <= image_size) {
        uint16_t place = image_at == image_size ? 0 : image_at;
        image_at++;
        if (hal_store_read((uint16_t)(image_slot + place)) != image[place]) {
            hal_store_write((uint16_t)(image_slot + place), image[place]);
            return true;
        }
    }
    return false;
}

enum params_saving params_poll(void)
{
    if (!writing) {
        return SAVING_IDLE;
    }
    if (hal_store_busy()) {
        return SAVING_GOES_ON;
    }
    if (write_next()) {
        return SAVING_GOES_ON;
    }
    if (!image_stands()) {
        if (!retried) {
            retried = true;
            image_at = 1;
            return SAVING_GOES_ON;
        }
        writing = false;
        return SAVING_FAILED;
    }
    writing = false;
    newest_sequence++;
    next_slot = image_slot == SLOT_0 ? SLOT_1 : SLOT_0;
    return SAVING_DONE;
}
