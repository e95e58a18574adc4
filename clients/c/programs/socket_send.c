/* socket_send.c: send three numbers to one program. */
#include "datagrams.h"

#include <stdio.h>

int main(int argc, char **argv)
{
    double numbers[NUMBERS];
    int port = ROB1_PORT;

    if (argc < 4 || argc > 6) {
        fprintf(stderr, "usage: %s NUMBER NUMBER NUMBER [HOST [PORT]] (%s, %d)\n", argv[0], THIS_MACHINE, port);
        return 2;
    }
    if (!read_numbers(argv + 1, numbers) || (argc == 6 && !read_whole(argv[5], 1, 65535, &port)))
        return 2;
    return send_to(argc >= 5 ? argv[4] : THIS_MACHINE, port, numbers) ? 0 : 1;
}
