/* Hides AVX-512 from a program, which then runs as on a processor that has AVX2 alone, at its full speed:
 *
 *     cc -O2 -shared -fPIC -o without-avx512.so tests/platforms/without-avx512.c
 *     LD_PRELOAD=$PWD/without-avx512.so kiln render scenes/assignment.toml -o picture.png --stats stats.json
 *
 * The processor is told to trap the instruction CPUID (arch_prctl(2), ARCH_SET_CPUID), and the handler answers as a
 * Haswell would, so that programs which choose code by the model of the processor do so, too. Linux on x86-64, on
 * processors with CPUID faulting (`cpuid_fault` in /proc/cpuinfo).
 */
#define _GNU_SOURCE
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/syscall.h>
#include <ucontext.h>
#include <unistd.h>

#define ARCH_SET_CPUID 0x1012

/* Family 6, model 0x3c. */
#define MODEL_BITS 0x0fff0ff0u
#define HASWELL 0x000306c0u

/* Bits of leaf 7 (Intel's manual, volume 2A, CPUID): AVX-512 in EBX, ECX and EDX, and what came after it: GFNI, VAES,
 * VPCLMULQDQ, AMX. */
#define LEAF_7_EBX (1u << 16 | 1u << 17 | 1u << 21 | 1u << 26 | 1u << 27 | 1u << 28 | 1u << 30 | 1u << 31)
#define LEAF_7_ECX (1u << 1 | 1u << 6 | 1u << 8 | 1u << 9 | 1u << 10 | 1u << 11 | 1u << 12 | 1u << 14)
#define LEAF_7_EDX (1u << 2 | 1u << 3 | 1u << 8 | 1u << 22 | 1u << 23 | 1u << 24 | 1u << 25)

static long allow(unsigned long on) { return syscall(SYS_arch_prctl, ARCH_SET_CPUID, on); }

static void answer(int signal_number, siginfo_t *info, void *context) {
    (void)info;
    greg_t *registers = ((ucontext_t *)context)->uc_mcontext.gregs;
    const unsigned char *code = (const unsigned char *)registers[REG_RIP];
    if (code[0] != 0x0f || code[1] != 0xa2) {
        /* A fault of the program: it occurs again, and ends it. */
        signal(signal_number, SIG_DFL);
        return;
    }
    unsigned leaf = (unsigned)registers[REG_RAX], part = (unsigned)registers[REG_RCX];
    unsigned a = leaf, b, c = part, d;
    allow(1);
    __asm__ volatile("cpuid" : "+a"(a), "=b"(b), "+c"(c), "=d"(d));
    allow(0);
    if (leaf == 1) {
        a = (a & ~MODEL_BITS) | HASWELL;
    } else if (leaf == 7 && part == 0) {
        b &= ~LEAF_7_EBX;
        c &= ~LEAF_7_ECX;
        d &= ~LEAF_7_EDX;
    } else if (leaf == 7) {
        a = b = c = d = 0;
    }
    registers[REG_RAX] = a;
    registers[REG_RBX] = b;
    registers[REG_RCX] = c;
    registers[REG_RDX] = d;
    registers[REG_RIP] += 2;
}

__attribute__((constructor)) static void hide(void) {
    struct sigaction action = {.sa_sigaction = answer, .sa_flags = SA_SIGINFO | SA_NODEFER | SA_ONSTACK};
    sigaction(SIGSEGV, &action, NULL);
    if (allow(0) != 0) {
        fputs("without-avx512: this processor or kernel cannot trap CPUID\n", stderr);
        exit(1);
    }
}
