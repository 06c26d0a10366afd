/* Preloaded, it kills the process before the n-th change of a file whose path has a text in it.

   A process that is killed in the midst of a write has written whole pages of it, so each page counts as a change. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

enum { PAGE = 4096 };

static long left = -1;
static char part[512];

void cut(long changes, const char *text) {
    left = changes;
    strncpy(part, text, sizeof part - 1);
}

static void changes(const char *path) {
    if (left >= 0 && strstr(path, part) && left-- == 0) {
        kill(getpid(), SIGKILL);
        for (;;)
            pause();
    }
}

static void changes_open(int file) {
    if (left < 0)
        return;
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    ssize_t length = readlink(link, path, sizeof path - 1);
    path[length < 0 ? 0 : length] = 0;
    changes(path);
}

#define NEXT(name, ...) ((__typeof__(name) *)dlsym(RTLD_NEXT, #name))(__VA_ARGS__)
#define WRITE(name, OFFSET) \
    ssize_t name(int file, const void *bytes, size_t count, OFFSET at) { \
        size_t done = 0; \
        do { \
            size_t piece = PAGE - (size_t)(at + done) % PAGE; \
            changes_open(file); \
            ssize_t now = NEXT(name, file, (const char *)bytes + done, piece < count - done ? piece : count - done, at + done); \
            if (now <= 0) \
                return done ? (ssize_t)done : now; \
            done += now; \
        } while (done < count); \
        return done; \
    }
#define RESIZE(name, OFFSET) \
    int name(int file, OFFSET size) { \
        changes_open(file); \
        return NEXT(name, file, size); \
    }
#define RENAME(name) \
    int name(const char *from, const char *to) { \
        changes(to); \
        return NEXT(name, from, to); \
    }

WRITE(pwrite, off_t)
WRITE(pwrite64, off64_t)
RESIZE(ftruncate, off_t)
RESIZE(ftruncate64, off64_t)
RENAME(rename)
RENAME(link)

ssize_t write(int file, const void *bytes, size_t count) {
    off_t at = lseek(file, 0, SEEK_CUR); /* -1 where there are no places, as in a pipe */
    size_t done = 0;
    do {
        size_t piece = at < 0 ? count : PAGE - (size_t)(at + done) % PAGE;
        changes_open(file);
        ssize_t now = NEXT(write, file, (const char *)bytes + done, piece < count - done ? piece : count - done);
        if (now <= 0)
            return done ? (ssize_t)done : now;
        done += now;
    } while (done < count);
    return done;
}

int posix_fallocate(int file, off_t at, off_t size) {
    changes_open(file);
    return NEXT(posix_fallocate, file, at, size);
}

int posix_fallocate64(int file, off64_t at, off64_t size) {
    changes_open(file);
    return NEXT(posix_fallocate64, file, at, size);
}

int fsync(int file) {
    changes_open(file);
    return NEXT(fsync, file);
}

int unlink(const char *path) {
    changes(path);
    return NEXT(unlink, path);
}
