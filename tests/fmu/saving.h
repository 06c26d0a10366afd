/* FMI's functions for the state of an instance that is one piece of memory, SAVED; `leave` has what is not part of it.
   -DBROKEN: how they fail. */
enum { SOUND, TAKES_NOTHING, CANNOT_WRITE, CANNOT_READ, SAYS_TOO_MUCH, FORGETS_ITS_INPUT, CRASHES };
#ifndef BROKEN
#define BROKEN SOUND
#endif
#if FMI == 2
#define G(second, third) fmi2##second##FMUstate##third
#define FMI_BYTE fmi2Byte
#define DESERIALIZE fmi2DeSerializeFMUstate
#else
#define G(second, third) fmi3##second##FMUState##third
#define FMI_BYTE fmi3Byte
#define DESERIALIZE fmi3DeserializeFMUState
#endif

Status G(Get, )(void *c, void **state) {
    if (!*state) *state = malloc(sizeof(SAVED));
    memcpy(*state, c, sizeof(SAVED));
    return OK;
}
Status G(Set, )(void *c, void *state) {
    SAVED own = *(SAVED *)c, *s = c;
    if (BROKEN == CRASHES) *(volatile int *)8 = 1;
    if (BROKEN == TAKES_NOTHING) return OK;
    *s = *(SAVED *)state;
    leave(s, &own);
    if (BROKEN == FORGETS_ITS_INPUT) s->u = 0;
    return OK;
}
Status G(Free, )(void *c, void **state) { free(*state); *state = NULL; return OK; }
Status G(Serialized, Size)(void *c, void *state, size_t *size) {
    *size = BROKEN == SAYS_TOO_MUCH ? (size_t)1 << 60 : sizeof(SAVED);
    return OK;
}
Status G(Serialize, )(void *c, void *state, FMI_BYTE bytes[], size_t size) {
    if (BROKEN == CANNOT_WRITE || size != sizeof(SAVED)) return ERROR;
    memcpy(bytes, state, size);
    return OK;
}
#if BROKEN != 3
Status DESERIALIZE(void *c, const FMI_BYTE bytes[], size_t size, void **state) {
    if (size != sizeof(SAVED)) return ERROR;
    if (!*state) *state = malloc(sizeof(SAVED));
    memcpy(*state, bytes, size);
    return OK;
}
#endif
