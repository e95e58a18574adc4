/* datagrams.c: the sockets and the text behind datagrams.h. */
#define _XOPEN_SOURCE 600
#define _DARWIN_C_SOURCE

#include "datagrams.h"

#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/types.h>
#include <unistd.h>

/* The address of a port for datagrams; NULL, with a sentence, if the host is unknown. */
static struct addrinfo *find(const char *host, int port)
{
    struct addrinfo wanted, *found;
    char name[16];
    int problem;

    memset(&wanted, 0, sizeof wanted);
    wanted.ai_family = AF_INET;
    wanted.ai_socktype = SOCK_DGRAM;
    sprintf(name, "%d", port);
    problem = getaddrinfo(host, name, &wanted, &found);
    if (problem == 0)
        return found;
    fprintf(stderr, "No machine %s: %s.\n", host, gai_strerror(problem));
    return NULL;
}

int listen_at(const char *address, int port)
{
    struct addrinfo *place = find(address, port);
    int one, heard;

    if (place == NULL)
        return -1;
    one = socket(AF_INET, SOCK_DGRAM, 0);
    heard = one != -1 && bind(one, place->ai_addr, place->ai_addrlen) == 0 && fcntl(one, F_SETFL, O_NONBLOCK) == 0;
    if (!heard)
        fprintf(stderr, "Cannot listen at %s, port %d: %s.\n", address, port, strerror(errno));
    freeaddrinfo(place);
    if (heard || one == -1)
        return one;
    close(one);
    return -1;
}

int hear(int listening, double numbers[NUMBERS])
{
    char text[DATAGRAM + 1];
    ssize_t length;

    while ((length = recv(listening, text, DATAGRAM, 0)) >= 0) {
        text[length] = '\0';
        if (sscanf(text, "%lf %lf %lf", &numbers[0], &numbers[1], &numbers[2]) == NUMBERS)
            return 1;
        fprintf(stderr, "A datagram came without three numbers.\n");
    }
    return 0;
}

int send_to(const char *host, int port, double numbers[NUMBERS])
{
    struct addrinfo *place = find(host, port);
    char text[DATAGRAM] = "";
    int one, sent;

    if (place == NULL)
        return 0;
    sprintf(text, "%12.2f %12.2f %12.2f", numbers[0], numbers[1], numbers[2]);
    one = socket(AF_INET, SOCK_DGRAM, 0);
    sent = one != -1 && sendto(one, text, sizeof text, 0, place->ai_addr, place->ai_addrlen) == DATAGRAM;
    if (!sent)
        fprintf(stderr, "Cannot send to %s, port %d: %s.\n", host, port, strerror(errno));
    if (one != -1)
        close(one);
    freeaddrinfo(place);
    return sent;
}

int read_numbers(char **words, double numbers[NUMBERS])
{
    char *end;
    int i;

    for (i = 0; i < NUMBERS; i++) {
        numbers[i] = strtod(words[i], &end);
        if (end == words[i] || *end != '\0' || !(numbers[i] >= LEAST_NUMBER && numbers[i] <= GREATEST_NUMBER)) {
            fprintf(stderr, "%s is no number from %.2f to %.2f.\n", words[i], LEAST_NUMBER, GREATEST_NUMBER);
            return 0;
        }
    }
    return 1;
}

int read_whole(const char *word, int least, int most, int *number)
{
    char *end;
    long found = strtol(word, &end, 10);

    if (end == word || *end != '\0' || found < least || found > most) {
        fprintf(stderr, "%s is no whole number from %d to %d.\n", word, least, most);
        return 0;
    }
    *number = (int) found;
    return 1;
}
