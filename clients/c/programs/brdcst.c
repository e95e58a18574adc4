/* brdcst.c: send the same three numbers to several programs, one after the other. */
#include "datagrams.h"

#include <stdio.h>
#include <string.h>

/* The host and the port of HOST:PORT or PORT; `place` is written to. */
static int read_place(char *place, const char **host, int *port)
{
    char *colon = strrchr(place, ':');

    *host = THIS_MACHINE;
    if (colon == NULL)
        return read_whole(place, 1, 65535, port);
    *colon = '\0';
    *host = place;
    return read_whole(colon + 1, 1, 65535, port);
}

int main(int argc, char **argv)
{
    double numbers[NUMBERS];
    const char *host;
    int i, port, failed = 0;

    if (argc < 4) {
        fprintf(stderr, "usage: %s NUMBER NUMBER NUMBER [[HOST:]PORT ...] (%d %d)\n", argv[0], ROB1_PORT, ROB2_PORT);
        return 2;
    }
    if (!read_numbers(argv + 1, numbers))
        return 2;
    if (argc == 4) {
        failed += !send_to(THIS_MACHINE, ROB1_PORT, numbers);
        failed += !send_to(THIS_MACHINE, ROB2_PORT, numbers);
    }
    for (i = 4; i < argc; i++) {
        if (!read_place(argv[i], &host, &port))
            return 2;
        failed += !send_to(host, port, numbers);
    }
    return failed ? 1 : 0;
}
