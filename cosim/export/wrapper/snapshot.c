/* FMU states: the arena and the progress of an instance in one block of memory that another process may read. */
#include "instance.h"

#include <stdlib.h>
#include <string.h>

typedef struct {
    char magic[8];
    uint64_t model; /* a hash of the model's token */
    uint64_t bytes; /* of the whole snapshot */
    uint32_t interface, events;
} Header;

static Header header(const Instance *i) {
    Header h;
    memset(&h, 0, sizeof h);
    memcpy(h.magic, "cosimFMU", sizeof h.magic);
    h.model = hash_bytes(HASH_BEGIN, model.token, strlen(model.token));
    h.bytes = snapshot_size();
    h.interface = i->interface;
    h.events = i->events;
    return h;
}

static bool fits(const Instance *i, const void *snapshot) {
    const Header own = header(i);
    return snapshot && !memcmp(snapshot, &own, sizeof own);
}

static Status refuse(Instance *i) {
    return tell(i, ERROR, LOG_ERROR, "this is no FMU state of an instance of the same model and kind");
}

size_t snapshot_size(void) {
    return sizeof(Header) + sizeof(Progress) + model.arena_bytes;
}

Status snapshot_take(Instance *i, void **snapshot) {
    if (!snapshot) return refuse(i);
    if (*snapshot && !fits(i, *snapshot)) return refuse(i);
    uint8_t *bytes = *snapshot ? *snapshot : malloc(snapshot_size());
    if (!bytes) return tell(i, ERROR, LOG_ERROR, "out of memory");
    const Header own = header(i);
    memcpy(bytes, &own, sizeof own);
    memcpy(bytes + sizeof own, &i->at, sizeof i->at);
    memcpy(bytes + sizeof own + sizeof i->at, i->arena, model.arena_bytes);
    *snapshot = bytes;
    return OK;
}

Status snapshot_restore(Instance *i, const void *snapshot) {
    if (!fits(i, snapshot)) return refuse(i);
    const uint8_t *bytes = (const uint8_t *)snapshot + sizeof(Header);
    memcpy(&i->at, bytes, sizeof i->at);
    memcpy(i->arena, bytes + sizeof i->at, model.arena_bytes);
    return OK;
}

Status snapshot_write(Instance *i, const void *snapshot, uint8_t *bytes, size_t size) {
    if (!fits(i, snapshot) || !bytes || size < snapshot_size()) return refuse(i);
    memcpy(bytes, snapshot, snapshot_size());
    return OK;
}

Status snapshot_read(Instance *i, const uint8_t *bytes, size_t size, void **snapshot) {
    if (!snapshot || size != snapshot_size() || !fits(i, bytes)) return refuse(i);
    if (*snapshot && !fits(i, *snapshot)) return refuse(i);
    if (!*snapshot) *snapshot = malloc(size);
    if (!*snapshot) return tell(i, ERROR, LOG_ERROR, "out of memory");
    memcpy(*snapshot, bytes, size);
    return OK;
}
