/* The first 256 bytes of the flash: the chip's ROM copies them into RAM, checks their CRC (scripts/firmware_image.py puts
   it there) and runs them. They let the flash be read in place by the plain read command 03, which every flash knows, and
   go to the program. Then the vector table and the start of C. */
  .syntax unified
  .cpu cortex-m0plus
  .thumb

  .section .boot, "ax"
  .global boot
boot:
  ldr r3, =0x18000000      /* SSI */
  movs r0, #0
  str r0, [r3, #8]         /* off */
  movs r0, #4
  str r0, [r3, #0x14]      /* a quarter of the clock */
  ldr r0, =(31 << 16 | 3 << 8)
  str r0, [r3]             /* 32 bits, read after command */
  movs r0, #0
  str r0, [r3, #4]
  ldr r0, =(3 << 24 | 2 << 8 | 6 << 2)
  ldr r1, =0x180000F4
  str r0, [r1]             /* command 03 of 8 bits, address of 24 bits */
  movs r0, #1
  str r0, [r3, #8]
  ldr r0, =vectors
  ldr r1, =0xE000ED08
  str r0, [r1]
  ldr r1, [r0]
  msr msp, r1
  ldr r1, [r0, #4]
  bx r1
  .ltorg

  .section .vectors, "a"
  .global vectors
vectors:
  .word stack_top
  .word start + 1
  .word hang + 1           /* NMI */
  .word hang + 1           /* HardFault: the chip's watchdog resets */
  .fill 44, 4, 0

  .section .text.start, "ax"
  .thumb_func
  .global start
start:
  ldr r0, =data_begin
  ldr r1, =data_end
  ldr r2, =data_source
1:cmp r0, r1
  bhs 2f
  ldr r3, [r2]
  str r3, [r0]
  adds r0, #4
  adds r2, #4
  b 1b
2:ldr r0, =bss_begin
  ldr r1, =bss_end
  movs r2, #0
3:cmp r0, r1
  bhs 4f
  str r2, [r0]
  adds r0, #4
  b 3b
4:bl main
  .thumb_func
hang:
  b hang
