/* socket_read.c: print the numbers of every datagram that comes. */
#define _XOPEN_SOURCE 600

#include "datagrams.h"

#include <limits.h>
#include <poll.h>
#include <stdio.h>

int main(int argc, char **argv)
{
    double numbers[NUMBERS];
    struct pollfd ready;
    int port = READER_PORT, count = 0, heard = 0;

    if (argc > 4 || (argc >= 2 && argv[1][0] == '-')) {
        fprintf(stderr, "usage: %s [PORT [COUNT [ADDRESS]]] (%d, 0: without end, %s)\n", argv[0], port, THIS_MACHINE);
        return 2;
    }
    if ((argc >= 2 && !read_whole(argv[1], 1, 65535, &port)) || (argc >= 3 && !read_whole(argv[2], 0, INT_MAX, &count)))
        return 2;
    ready.fd = listen_at(argc == 4 ? argv[3] : THIS_MACHINE, port);
    ready.events = POLLIN;
    if (ready.fd == -1)
        return 1;
    fprintf(stderr, "Listening at port %d.\n", port);
    while (count == 0 || heard < count) {
        if (!hear(ready.fd, numbers)) {
            poll(&ready, 1, -1);
            continue;
        }
        printf("%12.2f %12.2f %12.2f\n", numbers[0], numbers[1], numbers[2]);
        fflush(stdout);
        heard++;
    }
    return 0;
}
