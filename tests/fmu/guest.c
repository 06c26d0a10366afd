/* A test FMU for FMI 2.0, Co-Simulation, that is no good guest in the importer's process: `what` is what it does, in
   the functions of the bits of `where`. y = u + the number of steps. */

#include <fenv.h>
#include <locale.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "fmi2Functions.h"

enum { NOTHING, ROUND, FLUSH, FORK, FORK_EXEC, THREAD, ENVIRONMENT, LONG_MESSAGE };
enum { IN_STEP = 1, IN_GET = 2, IN_SET_UP = 4, IN_TERMINATE = 8, IN_FREE = 16 };
enum { U = 1, Y, WHAT, WHERE };

static void flush_to_zero(void) {
#if defined(__x86_64__)
    unsigned word = __builtin_ia32_stmxcsr();
    __builtin_ia32_ldmxcsr(word | 0x8040);
#elif defined(__aarch64__)
    unsigned long word;
    __asm__ volatile("mrs %0, fpcr" : "=r"(word));
    __asm__ volatile("msr fpcr, %0" : : "r"(word | 1ul << 24));
#endif
}

#ifdef FLUSHES_AS_IT_IS_LOADED /* as what is linked with -Ofast does */
__attribute__((constructor)) static void loaded(void) { flush_to_zero(); fesetround(FE_DOWNWARD); }
#endif

typedef struct {
    int what, where, steps;
    double u;
    const fmi2CallbackFunctions *functions;
} Guest;

static void say(Guest *g, fmi2Status status, const char *text) {
    g->functions->logger(g->functions->componentEnvironment, "guest", status, "logAll", "%s", text);
}

static void *talk(void *c) {
    for (int k = 0; k < 100; k++) say(c, fmi2Warning, "said by a thread");
    return NULL;
}

static void behave(Guest *g, int where) {
    pthread_t thread;
    pid_t child;
    if (!(g->where & where)) return;
    switch (g->what) {
    case ROUND: fesetround(FE_UPWARD); break;
    case FLUSH: flush_to_zero(); break;
    case FORK: fork(); break;
    case FORK_EXEC:
        child = fork();
        if (child == 0) execl("/bin/sh", "sh", "-c", "exit 7", (char *)NULL);
        int status;
        if (waitpid(child, &status, 0) != child || WEXITSTATUS(status) != 7) abort();
        break;
    case THREAD:
        pthread_create(&thread, NULL, talk, g);
        talk(g);
        pthread_join(thread, NULL);
        break;
    case ENVIRONMENT: {
        sigset_t all;
        sigfillset(&all);
        pthread_sigmask(SIG_BLOCK, &all, NULL);
        signal(SIGTERM, SIG_IGN);
        signal(SIGINT, SIG_IGN);
        chdir("/");
        setenv("LC_ALL", "de_DE.UTF-8", 1);
        setlocale(LC_ALL, "");
        break;
    }
    case LONG_MESSAGE: {
        char *text = malloc(3 << 20);
        memset(text, 'x', 3 << 20);
        memcpy(text, "long\033[31m", 9);
        text[(3 << 20) - 1] = 0;
        say(g, fmi2Warning, text);
        g->functions->logger(g->functions->componentEnvironment, "guest", fmi2Warning, "logAll", "%5000d", 7);
        free(text);
    }
    }
}

void *fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String where, const fmi2CallbackFunctions *f,
                      fmi2Boolean visible, fmi2Boolean logging) {
    Guest *g = calloc(1, sizeof *g);
    g->functions = f;
    return g;
}
fmi2Status fmi2SetDebugLogging(void *c, fmi2Boolean on, size_t n, const fmi2String categories[]) { return fmi2OK; }
fmi2Status fmi2SetupExperiment(void *c, fmi2Boolean a, double b, double start, fmi2Boolean d, double e) { return fmi2OK; }
fmi2Status fmi2EnterInitializationMode(void *c) { behave(c, IN_SET_UP); return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(void *c) { behave(c, IN_SET_UP); return fmi2OK; }
fmi2Status fmi2Terminate(void *c) { behave(c, IN_TERMINATE); return fmi2OK; }
void fmi2FreeInstance(void *c) { behave(c, IN_FREE); free(c); }
fmi2Status fmi2DoStep(void *c, double t, double h, fmi2Boolean keep) {
    Guest *g = c;
    g->steps++;
    behave(g, IN_STEP);
    return fmi2OK;
}
fmi2Status fmi2SetReal(void *c, const unsigned r[], size_t n, const double v[]) { ((Guest *)c)->u = v[0]; return fmi2OK; }
fmi2Status fmi2GetReal(void *c, const unsigned r[], size_t n, double v[]) {
    Guest *g = c;
    v[0] = g->u + g->steps;
    behave(g, IN_GET);
    return fmi2OK;
}
fmi2Status fmi2SetInteger(void *c, const unsigned r[], size_t n, const int v[]) {
    Guest *g = c;
    if (r[0] == WHAT) g->what = v[0]; else g->where = v[0];
    return fmi2OK;
}
