/* Standard input and output of a test program on the chip: its serial port, asked without
 * interrupts. */

#include <avr/io.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

int chip_main(void);

size_t chip_read(void *to, size_t size, size_t count, FILE *file)
{
    uint8_t *out = to;
    (void)file;
    for (size_t left = size * count; left > 0; left--) {
        while ((UCSR0A & _BV(RXC0)) == 0) {
        }
        *out++ = UDR0;
    }
    return count;
}

size_t chip_write(const void *from, size_t size, size_t count, FILE *file)
{
    const uint8_t *in = from;
    (void)file;
    for (size_t left = size * count; left > 0; left--) {
        while ((UCSR0A & _BV(UDRE0)) == 0) {
        }
        UDR0 = *in++;
    }
    return count;
}

#undef main
int main(void)
{
    UCSR0A = _BV(U2X0);
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UBRR0 = 0;
    UCSR0B = _BV(RXEN0) | _BV(TXEN0);
    return chip_main();
}
