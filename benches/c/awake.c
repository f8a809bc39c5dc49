/* Keeps every core from idling while something is measured: a virtual machine takes 50 us and more to wake from idle, at
 * whim, and that would be most of what is measured.
 *
 * One loop on each core, in the scheduler's idle class: it runs only when nothing else wants to, and gives way at once.
 * Ends when its standard input is closed. Prints a line when all are running.
 */
#define _GNU_SOURCE
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/prctl.h>
#include <unistd.h>

static void spin_on(int core) {
    cpu_set_t one;
    struct sched_param none = {0};
    CPU_ZERO(&one);
    CPU_SET(core, &one);
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (sched_setaffinity(0, sizeof one, &one) != 0 || sched_setscheduler(0, SCHED_IDLE, &none) != 0) _exit(1);
    for (;;) {
#if defined(__x86_64__)
        __builtin_ia32_pause();
#endif
    }
}

int main(void) {
    cpu_set_t allowed;
    char byte;
    if (sched_getaffinity(0, sizeof allowed, &allowed) != 0) return perror("awake"), 1;
    for (int core = 0; core < CPU_SETSIZE; core++) {
        if (!CPU_ISSET(core, &allowed)) continue;
        pid_t child = fork();
        if (child < 0) return perror("awake"), 1;
        if (child == 0) spin_on(core);
    }
    printf("awake\n");
    fflush(stdout);
    while (read(STDIN_FILENO, &byte, 1) > 0) {}
    return 0; /* the children go with it */
}
