/* Frames of the host as messages. */

#ifndef SMAD_INBOX_H
#define SMAD_INBOX_H

#include "smad_protocol.h"

/* A message whose layout is right, by its type. */
union message {
    struct smad_hello hello;
    struct smad_describe describe;
    struct smad_setpoint setpoint;
    struct smad_arm_request arm_request;
    struct smad_arm_confirm arm_confirm;
    struct smad_disarm disarm;
    struct smad_clear_fault clear_fault;
    struct smad_fault_get fault_get;
    struct smad_param_get param_get;
    struct smad_param_set param_set;
    struct smad_time_request time_request;
};

enum reading { READ_UNKNOWN, READ_BAD, READ_GOOD };

/* Reads the message that a frame carries; bad is one of a wrong length or with an unknown code. */
enum reading inbox_read(const struct smad_frame *frame, union message *m);

/* The axis that a request names; 0 for the two that name none. */
uint8_t inbox_axis(const struct smad_frame *frame);

#endif
