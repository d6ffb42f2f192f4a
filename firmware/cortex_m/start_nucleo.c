/* Clock, pins and timers of the Nucleo-F446RE; see hal_stm32f446.c for the pins. Never run. */

#include "nucleo.h"
#include "stm32f446.h"

/* 84 MHz from the 8 MHz that the ST-LINK gives; its own oscillator is off by too much. */
void nucleo_start_clock(void)
{
    RCC_CR |= BIT(18) | BIT(16);
    while ((RCC_CR & BIT(17)) == 0) {
    }
    RCC_PLLCFGR = 8u | 336u << 6 | 1u << 16 | BIT(22) | 7u << 24;
    RCC_CR |= BIT(24);
    while ((RCC_CR & BIT(25)) == 0) {
    }
    FLASH_ACR = 2u | BIT(8) | BIT(9) | BIT(10);
    RCC_CFGR = 4u << 10 | 2u;
    while ((RCC_CFGR & 0xCu) != 0x8u) {
    }
}

void nucleo_start_pins(void)
{
    GPIO_BSRR(GPIOC) = BIT(0) | BIT(2) | BIT(3) | BIT(4) | BIT(5) | BIT(6); /* nothing selected */
    /* 0 input, 1 output, 2 alternate, 3 analogue; two bits for each pin. */
    GPIO_MODER(GPIOA) = 0xA8000000uL | 3u << 0 | 3u << 2 | 2u << 4 | 2u << 6 | 3u << 8 | 1u << 10 | 2u << 12
                        | 2u << 14;
    GPIO_AFRL(GPIOA) = 7u << 8 | 7u << 12 | 2u << 24 | 2u << 28;
    GPIO_MODER(GPIOB) = 3u << 0 | 1u << 6 | 0u << 8 | 1u << 10 | 2u << 12 | 2u << 14;
    GPIO_AFRL(GPIOB) = 2u << 24 | 2u << 28;
    GPIO_PUPDR(GPIOB) = 1u << 12 | 1u << 14 | 1u << 16 | 1u << 18;
    GPIO_MODER(GPIOC) = 1u << 0 | 3u << 2 | 1u << 4 | 1u << 6 | 1u << 8 | 1u << 10 | 1u << 12
                        | 1u << 16 | 1u << 20 | 1u << 22 | 1u << 24;
    GPIO_PUPDR(GPIOC) = 1u << 14 | 1u << 18 | 1u << 26;
}

void nucleo_start_timers(void)
{
    TIM_PSC(TIM2) = 83;
    TIM_ARR(TIM2) = 0xFFFFFFFFu;
    TIM_EGR(TIM2) = 1;
    TIM_CR1(TIM2) = 1;
    TIM_PSC(TIM5) = 83;
    TIM_EGR(TIM5) = 1;
    /* Pumps at 31 kHz, 255 of 255 is full. */
    TIM_PSC(TIM3) = 10;
    TIM_ARR(TIM3) = 254;
    TIM_CCMR1(TIM3) = 6u << 4 | 6u << 12 | BIT(3) | BIT(11);
    TIM_CCER(TIM3) = BIT(0) | BIT(4);
    TIM_EGR(TIM3) = 1;
    TIM_CR1(TIM3) = 1;
    /* Encoder on both edges of both lines, filtered. */
    TIM_CCMR1(TIM4) = 1u | 1u << 8 | 3u << 4 | 3u << 12;
    TIM_SMCR(TIM4) = 3;
    TIM_ARR(TIM4) = 0xFFFFu;
    TIM_CR1(TIM4) = 1;
}
