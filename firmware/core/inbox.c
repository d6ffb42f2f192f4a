#include "inbox.h"

static enum reading as_reading(bool good)
{
    return good ? READ_GOOD : READ_BAD;
}

enum reading inbox_read(const struct smad_frame *frame, union message *m)
{
    const uint8_t *data = frame->payload;
    size_t size = frame->size;
    switch (frame->type) {
    case SMAD_HELLO_NUMBER:
        return as_reading(smad_unpack_hello(&m->hello, data, size));
    case SMAD_DESCRIBE_NUMBER:
        return as_reading(smad_unpack_describe(&m->describe, data, size));
    case SMAD_ESTOP_NUMBER:
    case SMAD_PARAM_SAVE_NUMBER:
        return as_reading(size == 0);
    case SMAD_SETPOINT_NUMBER:
        return as_reading(smad_unpack_setpoint(&m->setpoint, data, size));
    case SMAD_ARM_REQUEST_NUMBER:
        return as_reading(smad_unpack_arm_request(&m->arm_request, data, size));
    case SMAD_ARM_CONFIRM_NUMBER:
        return as_reading(smad_unpack_arm_confirm(&m->arm_confirm, data, size));
    case SMAD_DISARM_NUMBER:
        return as_reading(smad_unpack_disarm(&m->disarm, data, size));
    case SMAD_CLEAR_FAULT_NUMBER:
        return as_reading(smad_unpack_clear_fault(&m->clear_fault, data, size));
    case SMAD_FAULT_GET_NUMBER:
        return as_reading(smad_unpack_fault_get(&m->fault_get, data, size));
    case SMAD_PARAM_GET_NUMBER:
        return as_reading(smad_unpack_param_get(&m->param_get, data, size));
    case SMAD_PARAM_SET_NUMBER:
        return as_reading(smad_unpack_param_set(&m->param_set, data, size));
    case SMAD_TIME_REQUEST_NUMBER:
        return as_reading(smad_unpack_time_request(&m->time_request, data, size));
    default:
        return READ_UNKNOWN;
    }
}

/* The axis that a request names; all of them but two begin with it. */
uint8_t inbox_axis(const struct smad_frame *frame)
{
    bool none = frame->type == SMAD_DESCRIBE_NUMBER || frame->type == SMAD_PARAM_SAVE_NUMBER;
    return none ? 0 : frame->payload[0];
}
