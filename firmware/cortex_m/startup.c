/* Vectors, memory, and the three library functions of a program without a library. */

#include "stm32f446.h"

#include <stddef.h>
#include <string.h>

extern uint32_t data_from[];
extern uint32_t data_begin[];
extern uint32_t data_end[];
extern uint32_t bss_begin[];
extern uint32_t bss_end[];
extern uint32_t stack_top[];

int main(void);
void tim5_handler(void);
void usart2_handler(void);
void exti9_5_handler(void);
void reset_handler(void);

void *memcpy(void *restrict to, const void *restrict from, size_t size)
{
    unsigned char *out = to;
    const unsigned char *in = from;
    while (size-- > 0) {
        *out++ = *in++;
    }
    return to;
}

void *memset(void *to, int value, size_t size)
{
    unsigned char *out = to;
    while (size-- > 0) {
        *out++ = (unsigned char)value;
    }
    return to;
}

void *memmove(void *to, const void *from, size_t size)
{
    unsigned char *out = to;
    const unsigned char *in = from;
    if (out < in) {
        return memcpy(to, from, size);
    }
    while (size-- > 0) {
        out[size] = in[size];
    }
    return to;
}

void reset_handler(void)
{
    const uint32_t *from = data_from;
    for (uint32_t *to = data_begin; to < data_end; to++) {
        *to = *from++;
    }
    for (uint32_t *to = bss_begin; to < bss_end; to++) {
        *to = 0;
    }
    (void)main();
}

/* Whatever goes wrong ends here, and the watchdog ends it. */
static void stuck(void)
{
    for (;;) {
    }
}

typedef void (*vector)(void);

__attribute__((section(".vectors"), used)) static const vector VECTORS[16 + IRQS] = {
    [0] = (vector)stack_top,
    [1] = reset_handler,
    [2 ... 15] = stuck,
    [16 ... 16 + IRQ_EXTI9_5 - 1] = stuck,
    [16 + IRQ_EXTI9_5] = exti9_5_handler,
    [16 + IRQ_EXTI9_5 + 1 ... 16 + IRQ_USART2 - 1] = stuck,
    [16 + IRQ_USART2] = usart2_handler,
    [16 + IRQ_USART2 + 1 ... 16 + IRQ_TIM5 - 1] = stuck,
    [16 + IRQ_TIM5] = tim5_handler,
    [16 + IRQ_TIM5 + 1 ... 16 + IRQS - 1] = stuck,
};
