/* The registers of the STM32F446 that this port uses (reference manual RM0390). */

#ifndef SMAD_STM32F446_H
#define SMAD_STM32F446_H

#include <stdint.h>

#ifndef REG
#define REG(address) (*(volatile uint32_t *)(address))
#endif
#define BIT(n) (1uL << (n))

#define RCC 0x40023800uL
#define RCC_CR REG(RCC + 0x00)
#define RCC_PLLCFGR REG(RCC + 0x04)
#define RCC_CFGR REG(RCC + 0x08)
#define RCC_AHB1ENR REG(RCC + 0x30)
#define RCC_APB1ENR REG(RCC + 0x40)
#define RCC_APB2ENR REG(RCC + 0x44)
#define RCC_CSR REG(RCC + 0x74)
#define FLASH_ACR REG(0x40023C00uL)

#define GPIOA 0x40020000uL
#define GPIOB 0x40020400uL
#define GPIOC 0x40020800uL
#define GPIO_MODER(port) REG((port) + 0x00)
#define GPIO_PUPDR(port) REG((port) + 0x0C)
#define GPIO_IDR(port) REG((port) + 0x10)
#define GPIO_BSRR(port) REG((port) + 0x18)
#define GPIO_AFRL(port) REG((port) + 0x20)
#define GPIO_AFRH(port) REG((port) + 0x24)

#define TIM2 0x40000000uL /* clock, 32 bits */
#define TIM3 0x40000400uL /* pumps */
#define TIM4 0x40000800uL /* encoder */
#define TIM5 0x40000C00uL /* samples, 32 bits */
#define TIM_CR1(timer) REG((timer) + 0x00)
#define TIM_SMCR(timer) REG((timer) + 0x08)
#define TIM_DIER(timer) REG((timer) + 0x0C)
#define TIM_SR(timer) REG((timer) + 0x10)
#define TIM_EGR(timer) REG((timer) + 0x14)
#define TIM_CCMR1(timer) REG((timer) + 0x18)
#define TIM_CCER(timer) REG((timer) + 0x20)
#define TIM_CNT(timer) REG((timer) + 0x24)
#define TIM_PSC(timer) REG((timer) + 0x28)
#define TIM_ARR(timer) REG((timer) + 0x2C)
#define TIM_CCR1(timer) REG((timer) + 0x34)
#define TIM_CCR2(timer) REG((timer) + 0x38)

#define USART2 0x40004400uL
#define USART2_SR REG(USART2 + 0x00)
#define USART2_DR REG(USART2 + 0x04)
#define USART2_BRR REG(USART2 + 0x08)
#define USART2_CR1 REG(USART2 + 0x0C)

#define ADC1 0x40012000uL
#define ADC1_SR REG(ADC1 + 0x00)
#define ADC1_CR2 REG(ADC1 + 0x08)
#define ADC1_SMPR1 REG(ADC1 + 0x0C)
#define ADC1_SMPR2 REG(ADC1 + 0x10)
#define ADC1_SQR3 REG(ADC1 + 0x34)
#define ADC1_DR REG(ADC1 + 0x4C)
#define ADC_CCR REG(ADC1 + 0x304)

#define SYSCFG_EXTICR3 REG(0x40013810uL)
#define EXTI_IMR REG(0x40013C00uL)
#define EXTI_FTSR REG(0x40013C0CuL)
#define EXTI_PR REG(0x40013C14uL)

#define IWDG_KR REG(0x40003000uL)
#define IWDG_PR REG(0x40003004uL)
#define IWDG_RLR REG(0x40003008uL)

#define NVIC_ISER(n) REG(0xE000E100uL + 4u * (n))
#define UNIQUE_ID 0x1FFF7A10uL

#define IRQ_EXTI9_5 23u
#define IRQ_USART2 38u
#define IRQ_TIM5 50u
#define IRQS 97u

#endif
