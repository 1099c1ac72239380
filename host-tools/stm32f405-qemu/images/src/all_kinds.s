// R0: address of a counter that is not 0. R1: turns. Gives a sum in R0.
    .syntax unified
    .thumb
    .section .text.instructions_of_all_kinds, "ax"
    .global instructions_of_all_kinds
    .thumb_func
instructions_of_all_kinds:
    push {r4-r11, lr}
    mov r10, r0
    mov r11, r1
    movs r4, #0
    movw r5, #0x1234
    movt r5, #0x9876
1:
    ldr.w r0, [r10]
    // Sums, with and without carry; products.
    adds r1, r0, r4
    adcs r1, r5
    sbcs r1, r0
    adc r1, r1, #0x12000000
    sbcs.w r1, r1, r4, lsl #2
    eors r4, r1
    rsb.w r2, r4, #77
    rsbs r2, r2, #0
    adds r4, r4, r2
    mul r2, r0, r5
    muls r2, r0, r2
    mla r4, r2, r1, r4
    mls r4, r0, r1, r4
    umull r2, r3, r1, r5
    smull r2, r12, r1, r0
    add r4, r12
    umlal r2, r3, r4, r5
    smlal r2, r3, r4, r0
    add r4, r2
    add.w r4, r4, r3, lsl #3
    udiv r2, r5, r0
    sdiv r3, r4, r0
    add r4, r3
    // Logic, fields, orders of bytes.
    eor.w r4, r4, r2, ror #7
    orn r3, r3, r2
    orns r3, r3, #0x00ff00ff
    ands r3, r4
    orrs r4, r3
    bics r3, r0
    bic r2, r4, #0xff00
    mvns r2, r2
    mvn.w r3, #0xab000000
    add r4, r3
    ubfx r3, r4, #5, #9
    sbfx r12, r4, #3, #12
    add r4, r12
    bfi r4, r3, #8, #4
    bfc r2, #4, #5
    add r4, r2
    rev r3, r4
    rev16 r2, r3
    revsh r12, r2
    add r4, r12
    rev.w r12, r4
    clz r3, r12
    add r4, r3
    sxtb r2, r4
    sxth r3, r4
    add r4, r2
    uxtb r2, r4
    uxth.w r12, r4, ror #8
    sxtb.w r3, r4, ror #16
    add.w r4, r4, r12, asr #3
    // Shifts, whose carries are used.
    lsl.w r2, r4, r3
    lsrs r2, r3
    asrs r2, r0
    asrs r3, r4, #32
    adcs r4, r3
    lsrs r3, r4, #32
    adcs r4, r3
    lsls r3, r4, #5
    adcs r4, r3
    rors r4, r0
    rrxs r2, r4
    adcs r4, r2
    movs.w r2, #0x80000000
    adcs r4, r2
    asr.w r3, r4, r2
    ror.w r3, r4, #9
    // Conditions.
    it cs
    addcs r4, #1
    cmp r4, r5
    ite lt
    sublt r4, r4, r2
    eorge r4, r3
    cmp.w r4, #0x4000
    ittet hi
    addhi r4, #3
    lsrhi r2, r4, #1
    lslls r2, r4, #1
    eorhi r4, r2
    tst.w r4, #5
    ite eq
    moveq r3, #9
    movne r3, #10
    teq r4, r0
    it mi
    addmi r4, r3
    cmn r4, r5
    it vs
    addvs r4, #7
    cmn.w r4, #0x100
    it pl
    addpl r4, #11
    // Memory.
    strd r4, r5, [sp, #-8]!
    ldrd r2, r3, [sp], #8
    eors r4, r2
    add r4, r3
    push {r2, r4, lr}
    ldrb.w r2, [sp]
    ldrsb.w r3, [sp, #5]
    add r4, r2
    add r4, r3
    ldrh.w r12, [sp, #2]
    ldrsh.w r3, [sp, #6]
    add r4, r12
    add r4, r3
    mov r2, sp
    movs r3, #1
    ldr.w r12, [r2, r3, lsl #2]
    ldrsb r3, [r2, r3]
    str r4, [r2, #4]
    strb r0, [r2, #1]
    strh r0, [r2, #2]
    str r3, [sp]
    ldr r3, [sp, #4]
    add r4, r12
    ldr r2, [sp]
    eors r4, r2
    pop {r2, r3, lr}
    stmdb sp!, {r0, r4, r5}
    ldmia.w sp, {r1, r2, r3}
    mov r12, sp
    ldr r1, [r12], #4
    ldr r2, [r12, #4]!
    ldr r3, [r12, #-4]
    add sp, #12
    add r4, r3
    ldr r2, 4f
    eors r4, r2
    adr r2, 4f
    ldr r2, [r2]
    adds r4, r4, r2
    // Branches.
    bl 3f
    blx r1
    cbz r0, 2f
    cbnz r4, 2f
    nop
2:
    dmb
    subs.w r11, r11, #1
    bne.w 1b
    mov r0, r4
    pop {r4-r11, pc}
3:
    push {r4, lr}
    adr r1, 5f
    adds r1, #1
    tst r0, #2
    beq 6f
    pop {r4, pc}
6:
    pop {r4, lr}
    bx lr
    .balign 4
4:
    .word 0x5a17c3e9
    .balign 4
5:
    adds r4, #13
    bx lr
