/* socket_shell.c: send what is typed, three numbers a line, and print what comes, until the input ends. */
#define _XOPEN_SOURCE 600

#include "datagrams.h"

#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#define LONGEST_LINE 256

/* Send a line's numbers; empty lines are none. */
static void send_line(char *line, const char *host, int port)
{
    char *words[NUMBERS + 1];
    double numbers[NUMBERS];
    int count = 0;

    words[0] = strtok(line, " \t\r");
    while (words[count] != NULL && count < NUMBERS)
        words[++count] = strtok(NULL, " \t\r");
    if (count == 0)
        return;
    if (count < NUMBERS || words[NUMBERS] != NULL)
        fprintf(stderr, "Three numbers make a datagram.\n");
    else if (read_numbers(words, numbers) && send_to(host, port, numbers))
        fprintf(stderr, "sent\n");
}

/* Read what has been typed and send its whole lines; 0 at the end of the input. */
static int read_lines(const char *host, int port)
{
    static char typed[LONGEST_LINE];
    static size_t used = 0;
    ssize_t more = read(STDIN_FILENO, typed + used, sizeof typed - 1 - used);
    char *line = typed, *end;

    if (more <= 0) {
        typed[used] = '\0';
        send_line(typed, host, port);
        return 0;
    }
    used += (size_t) more;
    typed[used] = '\0';
    while ((end = strchr(line, '\n')) != NULL) {
        *end = '\0';
        send_line(line, host, port);
        line = end + 1;
    }
    used = strlen(line);
    memmove(typed, line, used + 1);
    if (used == sizeof typed - 1) {
        fprintf(stderr, "That line is too long.\n");
        used = 0;
    }
    return 1;
}

int main(int argc, char **argv)
{
    const char *host = argc >= 2 ? argv[1] : THIS_MACHINE;
    double numbers[NUMBERS];
    struct pollfd ready[2];
    int port = ROB1_PORT, own = READER_PORT;

    if (argc > 5 || (argc >= 2 && argv[1][0] == '-')) {
        fprintf(stderr, "usage: %s [HOST [PORT [OWN_PORT [OWN_ADDRESS]]]] (%s, %d, %d, %s)\n", argv[0], THIS_MACHINE,
                port, own, THIS_MACHINE);
        return 2;
    }
    if ((argc >= 3 && !read_whole(argv[2], 1, 65535, &port)) || (argc >= 4 && !read_whole(argv[3], 1, 65535, &own)))
        return 2;
    ready[0].fd = STDIN_FILENO;
    ready[1].fd = listen_at(argc == 5 ? argv[4] : THIS_MACHINE, own);
    ready[0].events = ready[1].events = POLLIN;
    if (ready[1].fd == -1)
        return 1;
    fprintf(stderr, "Three numbers a line go to %s, port %d; what comes to port %d is printed.\n", host, port, own);
    for (;;) {
        ready[0].revents = ready[1].revents = 0;
        poll(ready, 2, -1);
        while (hear(ready[1].fd, numbers))
            printf("%12.2f %12.2f %12.2f\n", numbers[0], numbers[1], numbers[2]);
        fflush(stdout);
        if (ready[0].revents != 0 && !read_lines(host, port))
            return 0;
    }
}
