/* ST RM0090: RCC 7.3, GPIO 8.4, TIM2 to TIM5 18.4. */
#include "board.h"

#include "cortex_m.h"

#define RCC_AHB1ENR REGISTER32(0x40023830u)
#define RCC_APB1ENR REGISTER32(0x40023840u)
#define RCC_APB2ENR REGISTER32(0x40023844u)
#define GPIOA_MODER REGISTER32(0x40020000u)
#define GPIOA_BSRR REGISTER32(0x40020018u)
#define GPIOA_AFRL REGISTER32(0x40020020u)
#define GPIOA_AFRH REGISTER32(0x40020024u)
#define TIM5_CR1 REGISTER32(0x40000C00u)
#define TIM5_CNT REGISTER32(0x40000C24u)

enum { OUTPUT = 1, ALTERNATE = 2 };

static void pin_mode(unsigned pin, uint32_t mode) {
  GPIOA_MODER = (GPIOA_MODER & ~(3u << (2u * pin))) | mode << (2u * pin);
}

void board_start(void) {
  RCC_AHB1ENR |= 1u << 0;            /* GPIOA */
  RCC_APB2ENR |= 1u << 4;            /* USART1 */
  RCC_APB1ENR |= 1u << 17 | 1u << 3; /* USART2, TIM5 */
  board_drive(false);
  pin_mode(8, OUTPUT);
  GPIOA_AFRH = (GPIOA_AFRH & ~0x00000FF0u) | 0x00000770u; /* PA9, PA10: AF7 */
  GPIOA_AFRL = (GPIOA_AFRL & ~0x0000FF00u) | 0x00007700u; /* PA2, PA3: AF7 */
  pin_mode(9, ALTERNATE);
  pin_mode(10, ALTERNATE);
  pin_mode(2, ALTERNATE);
  pin_mode(3, ALTERNATE);
  TIM5_CR1 = 1;
}

void board_drive(bool on) { GPIOA_BSRR = on ? 1u << 8 : 1u << (8 + 16); }

uint32_t board_counter(void) { return TIM5_CNT; }
