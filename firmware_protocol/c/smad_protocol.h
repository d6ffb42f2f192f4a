/* Made by `python -m firmware_protocol.generate`; do not edit.
 * Every number on the wire is little-endian. See docs/protocol.md. */

#ifndef SMAD_PROTOCOL_H
#define SMAD_PROTOCOL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Tables that stay in flash where RAM has an address space of its own. */
#ifdef __AVR__
#define SMAD_FLASH __flash
#else
#define SMAD_FLASH
#endif

#define SMAD_PROTOCOL_MAJOR 1
#define SMAD_PROTOCOL_MINOR 0
#define SMAD_SCHEMA_CRC 0xD3DF5E0Bu
#define SMAD_SCHEMA_SIZE 2406
#define SMAD_PARAMETER_COUNT 33
#define SMAD_PARAMETER_NAME 30
#define SMAD_MAX_DECODED 128
#define SMAD_MAX_PAYLOAD 120
#define SMAD_MAX_ENCODED 129
#define SMAD_MAX_WIRE 130
#define SMAD_PERIODIC_BYTES_PER_S 76u
#define SMAD_SETPOINT_AGE_US 50000
#define SMAD_NO_FIELD 0xFF
#define SMAD_INVALID_U8 0xFF
#define SMAD_INVALID_U16 0xFFFF
#define SMAD_INVALID_I16 (-32767 - 1)
#define SMAD_INVALID_I32 (-2147483647 - 1)

enum smad_board_state {
    SMAD_BOARD_STATE_BOOT = 0,
    SMAD_BOARD_STATE_SAFE = 1,
    SMAD_BOARD_STATE_ARMED = 2,
    SMAD_BOARD_STATE_HOLD = 3,
    SMAD_BOARD_STATE_COOL = 4,
    SMAD_BOARD_STATE_FAULT = 5,
    SMAD_BOARD_STATE_ESTOP = 6,
};

enum smad_capability {
    SMAD_CAPABILITY_ENCODER = 1,
    SMAD_CAPABILITY_FORCE_SENSOR = 2,
    SMAD_CAPABILITY_VOLTAGE_SENSE = 4,
    SMAD_CAPABILITY_RTD_INLET = 8,
    SMAD_CAPABILITY_RTD_AMBIENT = 16,
    SMAD_CAPABILITY_DRAIN = 32,
    SMAD_CAPABILITY_STAGE = 64,
    SMAD_CAPABILITY_LEAK_SENSOR = 128,
    SMAD_CAPABILITY_PUMP_TACHO = 256,
    SMAD_CAPABILITY_PARAMETER_STORE = 512,
};

enum smad_channel {
    SMAD_CHANNEL_SPRING_X = 0,
    SMAD_CHANNEL_SPRING_Y = 1,
    SMAD_CHANNEL_INLET = 2,
    SMAD_CHANNEL_AMBIENT = 3,
    SMAD_CHANNEL_BOARD = 4,
    SMAD_CHANNEL_ENCODER = 5,
    SMAD_CHANNEL_FORCE = 6,
};

enum smad_error_code {
    SMAD_ERROR_CODE_UNKNOWN = 0,
    SMAD_ERROR_CODE_WRONG_STATE = 1,
    SMAD_ERROR_CODE_NO_SESSION = 2,
    SMAD_ERROR_CODE_SCHEMA_DIFFERS = 3,
    SMAD_ERROR_CODE_PARAMETERS_DIFFER = 4,
    SMAD_ERROR_CODE_CLOCK_UNLOCKED = 5,
    SMAD_ERROR_CODE_SENSOR_INVALID = 6,
    SMAD_ERROR_CODE_TOO_HOT = 7,
    SMAD_ERROR_CODE_CURRENT_FLOWING = 8,
    SMAD_ERROR_CODE_FAULT_PRESENT = 9,
    SMAD_ERROR_CODE_SUPPLY_LOW = 10,
    SMAD_ERROR_CODE_TOKEN_WRONG = 11,
    SMAD_ERROR_CODE_TOKEN_EXPIRED = 12,
    SMAD_ERROR_CODE_WRONG_FAULT = 13,
    SMAD_ERROR_CODE_CAUSE_REMAINS = 14,
    SMAD_ERROR_CODE_SETPOINT_STALE = 15,
    SMAD_ERROR_CODE_UNKNOWN_TYPE = 32,
    SMAD_ERROR_CODE_BAD_PAYLOAD = 33,
    SMAD_ERROR_CODE_MAJOR_DIFFERS = 34,
    SMAD_ERROR_CODE_NO_SUCH_AXIS = 35,
    SMAD_ERROR_CODE_OUT_OF_RANGE = 36,
    SMAD_ERROR_CODE_UNKNOWN_PARAMETER = 37,
    SMAD_ERROR_CODE_NO_SUCH_REPORT = 38,
    SMAD_ERROR_CODE_RATE_TOO_HIGH = 39,
    SMAD_ERROR_CODE_SAVE_FAILED = 40,
};

enum smad_fault {
    SMAD_FAULT_NONE = 0,
    SMAD_FAULT_SELF_TEST = 1,
    SMAD_FAULT_PARAM_CRC = 2,
    SMAD_FAULT_BROWN_OUT = 3,
    SMAD_FAULT_LOOP_OVERRUN = 4,
    SMAD_FAULT_SETPOINT_LOST = 5,
    SMAD_FAULT_OVER_TEMPERATURE = 6,
    SMAD_FAULT_SENSOR_INVALID = 7,
    SMAD_FAULT_SENSOR_OPEN = 8,
    SMAD_FAULT_SENSOR_SHORT = 9,
    SMAD_FAULT_SENSOR_STUCK = 10,
    SMAD_FAULT_SENSOR_IMPLAUSIBLE = 11,
    SMAD_FAULT_SENSORS_SWAPPED = 12,
    SMAD_FAULT_NOT_HEATING = 13,
    SMAD_FAULT_UNCOMMANDED_CURRENT = 14,
    SMAD_FAULT_HEATING_WHILE_OFF = 15,
    SMAD_FAULT_MODEL_RESIDUAL = 16,
    SMAD_FAULT_RESISTANCE_OUT_OF_BAND = 17,
    SMAD_FAULT_RESISTANCE_RTD_DISAGREE = 18,
    SMAD_FAULT_CURRENT_HIGH = 19,
    SMAD_FAULT_CURRENT_LOW = 20,
    SMAD_FAULT_WIRE_OPEN = 21,
    SMAD_FAULT_DRIVER_OPEN = 22,
    SMAD_FAULT_I2T = 23,
    SMAD_FAULT_ARMED_TOO_LONG = 24,
    SMAD_FAULT_PUMP_DRY = 25,
    SMAD_FAULT_PUMP_STALLED = 26,
    SMAD_FAULT_PUMP_STUCK_ON = 27,
    SMAD_FAULT_NO_COOLING = 28,
    SMAD_FAULT_LEAK = 29,
    SMAD_FAULT_ESTOP_PRESSED = 30,
    SMAD_FAULT_OVER_CURRENT = 31,
};

enum smad_limiter {
    SMAD_LIMITER_NONE = 0,
    SMAD_LIMITER_SLEW = 1,
    SMAD_LIMITER_MAXIMUM = 2,
    SMAD_LIMITER_I2T = 3,
    SMAD_LIMITER_TEMPERATURE = 4,
    SMAD_LIMITER_GATE = 5,
};

enum smad_parameter_kind {
    SMAD_PARAMETER_KIND_NUMBER = 0,
    SMAD_PARAMETER_KIND_CHOICE = 1,
    SMAD_PARAMETER_KIND_SWITCH = 2,
};

enum smad_reset_cause {
    SMAD_RESET_CAUSE_UNKNOWN = 0,
    SMAD_RESET_CAUSE_POWER_ON = 1,
    SMAD_RESET_CAUSE_PIN = 2,
    SMAD_RESET_CAUSE_SOFTWARE = 3,
    SMAD_RESET_CAUSE_WATCHDOG = 4,
    SMAD_RESET_CAUSE_BROWN_OUT = 5,
};

enum smad_setpoint_flag {
    SMAD_SETPOINT_FLAG_DRAIN_X = 1,
    SMAD_SETPOINT_FLAG_DRAIN_Y = 2,
    SMAD_SETPOINT_FLAG_STAGE = 4,
};

enum smad_valid_bit {
    SMAD_VALID_BIT_I_X = 1,
    SMAD_VALID_BIT_I_Y = 2,
    SMAD_VALID_BIT_V_X = 4,
    SMAD_VALID_BIT_V_Y = 8,
    SMAD_VALID_BIT_RTD_X = 16,
    SMAD_VALID_BIT_RTD_Y = 32,
    SMAD_VALID_BIT_RTD_INLET = 64,
    SMAD_VALID_BIT_RTD_AMBIENT = 128,
    SMAD_VALID_BIT_ENCODER = 256,
    SMAD_VALID_BIT_FORCE = 512,
    SMAD_VALID_BIT_VBUS = 1024,
    SMAD_VALID_BIT_SETPOINT = 2048,
};

enum smad_warning {
    SMAD_WARNING_SETPOINT_STALE = 0,
    SMAD_WARNING_RTD_JUMP = 1,
    SMAD_WARNING_NEAR_TEMPERATURE_LIMIT = 2,
    SMAD_WARNING_NEAR_I2T_LIMIT = 3,
    SMAD_WARNING_SUPPLY_LOW = 4,
    SMAD_WARNING_LOOP_LATE = 5,
    SMAD_WARNING_COOL_CAP = 6,
    SMAD_WARNING_SENSOR_INVALID = 7,
};

#define SMAD_HELLO_NUMBER 0x01
#define SMAD_HELLO_SIZE 10

struct smad_hello {
    uint8_t major;
    uint8_t minor;
    uint32_t schema_crc;
    uint32_t nonce;
};

void smad_pack_hello(const struct smad_hello *m, uint8_t out[SMAD_HELLO_SIZE]);
bool smad_unpack_hello(struct smad_hello *m, const uint8_t *data, size_t size);

#define SMAD_DESCRIBE_NUMBER 0x02
#define SMAD_DESCRIBE_SIZE 2

struct smad_describe {
    uint16_t offset; /* B */
};

void smad_pack_describe(const struct smad_describe *m, uint8_t out[SMAD_DESCRIBE_SIZE]);
bool smad_unpack_describe(struct smad_describe *m, const uint8_t *data, size_t size);

#define SMAD_ESTOP_NUMBER 0x03
#define SMAD_ESTOP_SIZE 0

#define SMAD_SETPOINT_NUMBER 0x10
#define SMAD_SETPOINT_SIZE 18

struct smad_setpoint {
    uint8_t axis;
    uint32_t t_ref_us;
    uint16_t i_mA[2]; /* mA */
    uint8_t pump_duty[2]; /* 1/255 */
    uint8_t flags; /* enum smad_setpoint_flag */
    uint16_t ttl_ms; /* ms */
    int32_t stage_um; /* um */
};

void smad_pack_setpoint(const struct smad_setpoint *m, uint8_t out[SMAD_SETPOINT_SIZE]);
bool smad_unpack_setpoint(struct smad_setpoint *m, const uint8_t *data, size_t size);

#define SMAD_ARM_REQUEST_NUMBER 0x11
#define SMAD_ARM_REQUEST_SIZE 5

struct smad_arm_request {
    uint8_t axis;
    uint32_t param_crc;
};

void smad_pack_arm_request(const struct smad_arm_request *m, uint8_t out[SMAD_ARM_REQUEST_SIZE]);
bool smad_unpack_arm_request(struct smad_arm_request *m, const uint8_t *data, size_t size);

#define SMAD_ARM_CONFIRM_NUMBER 0x12
#define SMAD_ARM_CONFIRM_SIZE 5

struct smad_arm_confirm {
    uint8_t axis;
    uint32_t token;
};

void smad_pack_arm_confirm(const struct smad_arm_confirm *m, uint8_t out[SMAD_ARM_CONFIRM_SIZE]);
bool smad_unpack_arm_confirm(struct smad_arm_confirm *m, const uint8_t *data, size_t size);

#define SMAD_DISARM_NUMBER 0x13
#define SMAD_DISARM_SIZE 1

struct smad_disarm {
    uint8_t axis;
};

void smad_pack_disarm(const struct smad_disarm *m, uint8_t out[SMAD_DISARM_SIZE]);
bool smad_unpack_disarm(struct smad_disarm *m, const uint8_t *data, size_t size);

#define SMAD_CLEAR_FAULT_NUMBER 0x14
#define SMAD_CLEAR_FAULT_SIZE 2

struct smad_clear_fault {
    uint8_t axis;
    uint8_t fault; /* enum smad_fault */
};

void smad_pack_clear_fault(const struct smad_clear_fault *m, uint8_t out[SMAD_CLEAR_FAULT_SIZE]);
bool smad_unpack_clear_fault(struct smad_clear_fault *m, const uint8_t *data, size_t size);

#define SMAD_FAULT_GET_NUMBER 0x15
#define SMAD_FAULT_GET_SIZE 2

struct smad_fault_get {
    uint8_t axis;
    uint8_t index;
};

void smad_pack_fault_get(const struct smad_fault_get *m, uint8_t out[SMAD_FAULT_GET_SIZE]);
bool smad_unpack_fault_get(struct smad_fault_get *m, const uint8_t *data, size_t size);

#define SMAD_PARAM_GET_NUMBER 0x16
#define SMAD_PARAM_GET_SIZE 3

struct smad_param_get {
    uint8_t axis;
    uint16_t param;
};

void smad_pack_param_get(const struct smad_param_get *m, uint8_t out[SMAD_PARAM_GET_SIZE]);
bool smad_unpack_param_get(struct smad_param_get *m, const uint8_t *data, size_t size);

#define SMAD_PARAM_SET_NUMBER 0x17
#define SMAD_PARAM_SET_SIZE 7

struct smad_param_set {
    uint8_t axis;
    uint16_t param;
    int32_t value;
};

void smad_pack_param_set(const struct smad_param_set *m, uint8_t out[SMAD_PARAM_SET_SIZE]);
bool smad_unpack_param_set(struct smad_param_set *m, const uint8_t *data, size_t size);

#define SMAD_PARAM_SAVE_NUMBER 0x18
#define SMAD_PARAM_SAVE_SIZE 0

#define SMAD_TIME_REQUEST_NUMBER 0x19
#define SMAD_TIME_REQUEST_SIZE 4

struct smad_time_request {
    uint32_t t1_us; /* us */
};

void smad_pack_time_request(const struct smad_time_request *m, uint8_t out[SMAD_TIME_REQUEST_SIZE]);
bool smad_unpack_time_request(struct smad_time_request *m, const uint8_t *data, size_t size);

#define SMAD_IDENT_NUMBER 0x81
#define SMAD_IDENT_SIZE 69

struct smad_ident {
    uint8_t major;
    uint8_t minor;
    uint32_t schema_crc;
    uint32_t param_crc;
    uint32_t nonce;
    uint16_t session;
    uint32_t boot_count;
    uint8_t reset_cause; /* enum smad_reset_cause */
    uint8_t first_fault;
    uint8_t axes;
    uint32_t capabilities; /* enum smad_capability */
    uint16_t state_rate_hz; /* Hz */
    uint32_t baud; /* Bd */
    uint8_t uid[12];
    char firmware[24];
};

void smad_pack_ident(const struct smad_ident *m, uint8_t out[SMAD_IDENT_SIZE]);
bool smad_unpack_ident(struct smad_ident *m, const uint8_t *data, size_t size);

#define SMAD_DESCRIPTION_NUMBER 0x82
#define SMAD_DESCRIPTION_SIZE 101

struct smad_description {
    uint16_t offset; /* B */
    uint16_t total; /* B */
    uint8_t size; /* B */
    uint8_t data[96];
};

void smad_pack_description(const struct smad_description *m, uint8_t out[SMAD_DESCRIPTION_SIZE]);
bool smad_unpack_description(struct smad_description *m, const uint8_t *data, size_t size);

#define SMAD_ERROR_NUMBER 0x83
#define SMAD_ERROR_SIZE 12

struct smad_error {
    uint8_t request_type;
    uint8_t request_seq;
    uint8_t code; /* enum smad_error_code */
    uint8_t field;
    int32_t value;
    int32_t limit;
};

void smad_pack_error(const struct smad_error *m, uint8_t out[SMAD_ERROR_SIZE]);
bool smad_unpack_error(struct smad_error *m, const uint8_t *data, size_t size);

#define SMAD_STATE_NUMBER 0x90
#define SMAD_STATE_SIZE 52

struct smad_state {
    uint8_t axis;
    uint32_t t_us; /* us */
    uint16_t tick;
    uint8_t mode; /* enum smad_board_state */
    uint8_t limiter; /* enum smad_limiter */
    uint32_t faults; /* enum smad_fault */
    uint16_t warnings; /* enum smad_warning */
    int16_t i_meas_mA[2]; /* mA */
    int16_t i_applied_mA[2]; /* mA */
    uint16_t v_mV[2]; /* mV */
    uint8_t pump_duty[2]; /* 1/255 */
    int16_t rtd_cC[4]; /* cC */
    int32_t encoder_counts; /* counts */
    int32_t force_counts; /* counts */
    uint16_t vbus_mV; /* mV */
    uint16_t valid; /* enum smad_valid_bit */
    uint8_t sp_seq;
    uint16_t sp_age_us; /* us */
};

void smad_pack_state(const struct smad_state *m, uint8_t out[SMAD_STATE_SIZE]);
bool smad_unpack_state(struct smad_state *m, const uint8_t *data, size_t size);

#define SMAD_FAULT_REPORT_NUMBER 0x91
#define SMAD_FAULT_REPORT_SIZE 68

struct smad_fault_report {
    uint8_t axis;
    uint8_t index;
    uint8_t fault; /* enum smad_fault */
    uint8_t channel; /* enum smad_channel */
    uint32_t t_us; /* us */
    int32_t measured;
    int32_t limit;
    struct smad_state snapshot;
};

void smad_pack_fault_report(const struct smad_fault_report *m, uint8_t out[SMAD_FAULT_REPORT_SIZE]);
bool smad_unpack_fault_report(struct smad_fault_report *m, const uint8_t *data, size_t size);

#define SMAD_ARM_TOKEN_NUMBER 0x92
#define SMAD_ARM_TOKEN_SIZE 7

struct smad_arm_token {
    uint8_t axis;
    uint32_t token;
    uint16_t valid_ms; /* ms */
};

void smad_pack_arm_token(const struct smad_arm_token *m, uint8_t out[SMAD_ARM_TOKEN_SIZE]);
bool smad_unpack_arm_token(struct smad_arm_token *m, const uint8_t *data, size_t size);

#define SMAD_DONE_NUMBER 0x93
#define SMAD_DONE_SIZE 5

struct smad_done {
    uint8_t request_type;
    uint32_t t_us; /* us */
};

void smad_pack_done(const struct smad_done *m, uint8_t out[SMAD_DONE_SIZE]);
bool smad_unpack_done(struct smad_done *m, const uint8_t *data, size_t size);

#define SMAD_PARAM_VALUE_NUMBER 0x94
#define SMAD_PARAM_VALUE_SIZE 20

struct smad_param_value {
    uint8_t axis;
    uint16_t param;
    uint8_t kind; /* enum smad_parameter_kind */
    int32_t value;
    int32_t minimum;
    int32_t maximum;
    uint32_t param_crc;
};

void smad_pack_param_value(const struct smad_param_value *m, uint8_t out[SMAD_PARAM_VALUE_SIZE]);
bool smad_unpack_param_value(struct smad_param_value *m, const uint8_t *data, size_t size);

#define SMAD_TIME_REPLY_NUMBER 0x95
#define SMAD_TIME_REPLY_SIZE 12

struct smad_time_reply {
    uint32_t t1_us; /* us */
    uint32_t t2_us; /* us */
    uint32_t t3_us; /* us */
};

void smad_pack_time_reply(const struct smad_time_reply *m, uint8_t out[SMAD_TIME_REPLY_SIZE]);
bool smad_unpack_time_reply(struct smad_time_reply *m, const uint8_t *data, size_t size);

#define SMAD_LINK_STATS_NUMBER 0x96
#define SMAD_LINK_STATS_SIZE 44

struct smad_link_stats {
    uint32_t frames;
    uint32_t crc_errors;
    uint32_t cobs_errors;
    uint32_t length_errors;
    uint32_t payload_errors;
    uint32_t session_errors;
    uint32_t stale_setpoints;
    uint32_t repeated_requests;
    uint32_t dropped_states;
    uint32_t overruns;
    uint32_t longest_loop_us; /* us */
};

void smad_pack_link_stats(const struct smad_link_stats *m, uint8_t out[SMAD_LINK_STATS_SIZE]);
bool smad_unpack_link_stats(struct smad_link_stats *m, const uint8_t *data, size_t size);

/* CRC-32 as in zlib, Ethernet and PNG. */
uint32_t smad_crc32(const uint8_t *data, size_t size);

/* Carries on a CRC-32 over more bytes; the CRC of none is 0. */
uint32_t smad_crc32_more(uint32_t crc, const uint8_t *data, size_t size);

/* Writes the frame of a payload, delimiter included, to `out` (SMAD_MAX_WIRE bytes).
 * Returns its length, or 0 if the payload is longer than SMAD_MAX_PAYLOAD. */
size_t smad_frame_encode(uint8_t type, uint8_t seq, uint16_t session, const uint8_t *payload,
                         size_t size, uint8_t *out);

struct smad_frame {
    uint8_t type;
    uint8_t seq;
    uint16_t session;
    uint8_t size; /* of the payload */
    uint8_t payload[SMAD_MAX_PAYLOAD];
};

struct smad_decoder {
    uint32_t frames;
    uint32_t length_errors;
    uint32_t cobs_errors;
    uint32_t crc_errors;
    uint32_t dropped_bytes;
    uint16_t size;
    bool too_long;
    uint8_t buffer[SMAD_MAX_ENCODED];
};

void smad_decoder_init(struct smad_decoder *decoder);

/* Takes in one byte. Returns true, and fills `frame`, if it completed a good frame. */
bool smad_decoder_byte(struct smad_decoder *decoder, uint8_t byte, struct smad_frame *frame);

/* The door for setpoints, one for each axis; clear it when a session begins. */
struct smad_setpoint_gate {
    int64_t ref_us;
    uint8_t seq;
    bool passed;
};

/* Returns the age in us of a setpoint that may pass, -1 for one that is too old or was overtaken.
 * `now_us` is the board's time, not wrapped: 32 bits cannot tell a setpoint that comes after a
 * pause of 36 to 72 minutes from one that was overtaken. */
int64_t smad_setpoint_gate_admit(struct smad_setpoint_gate *gate, uint32_t t_ref_us, uint8_t seq,
                                 int64_t now_us);

struct smad_parameter {
    uint16_t number;
    uint8_t kind;
    bool shared; /* one for the whole board, kept by axis 0 */
    bool never_zero;
    int32_t initial;
    int32_t minimum;
    int32_t maximum;
    char name[SMAD_PARAMETER_NAME];
};

extern const SMAD_FLASH struct smad_parameter smad_parameters[SMAD_PARAMETER_COUNT];

/* The description that DESCRIBE hands out: JSON, compressed with zlib. */
extern const SMAD_FLASH uint8_t smad_schema[SMAD_SCHEMA_SIZE];

#endif
