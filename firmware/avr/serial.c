/* The serial port, on interrupts. */

#include "hal.h"
#include "mega.h"

#include <avr/interrupt.h>

static volatile uint8_t received[256];
static volatile uint8_t received_head;
static volatile uint8_t received_tail;
static volatile uint8_t to_send[256];
static volatile uint8_t to_send_head;
static volatile uint8_t to_send_tail;

ISR(USART0_RX_vect)
{
    uint8_t byte = UDR0;
    uint8_t next = (uint8_t)(received_head + 1u);
    if (next != received_tail) {
        received[received_head] = byte;
        received_head = next;
    }
}

ISR(USART0_UDRE_vect)
{
    uint8_t tail = to_send_tail;
    UDR0 = to_send[tail];
    tail++;
    to_send_tail = tail;
    if (tail == to_send_head) {
        UCSR0B &= (uint8_t)~_BV(UDRIE0);
    }
}

int hal_serial_read(void)
{
    uint8_t byte;
    if (received_tail == received_head) {
        return -1;
    }
    byte = received[received_tail];
    received_tail++;
    return byte;
}

uint16_t hal_serial_room(void)
{
    return (uint8_t)(to_send_tail - to_send_head - 1u);
}

void hal_serial_write(const uint8_t *data, uint16_t size)
{
    uint8_t head = to_send_head;
    for (uint8_t left = (uint8_t)size; left > 0; left--) {
        to_send[head] = *data++;
        head++;
    }
    to_send_head = head;
}

bool mega_received(void)
{
    return received_tail != received_head;
}

void mega_send(void)
{
    if (to_send_head != to_send_tail) {
        UCSR0B |= _BV(UDRIE0);
    }
}

void mega_start_serial(void)
{
    UCSR0A = _BV(U2X0);
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UBRR0 = (uint16_t)UBRR_EXACT;
    UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
}

uint32_t hal_serial_baud(void)
{
    return BAUD;
}
