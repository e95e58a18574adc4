/*
 * A user's own packets, as programs of 1998 made them: packets PORT. Prints what each call gave, then what a server
 * answers to two packets of the arm, made by hand and by its own call.
 */
#include "Nclient.h"

#include <stdio.h>
#include <stdlib.h>

static unsigned char request[USER_BUFFER_LENGTH], reply[USER_BUFFER_LENGTH];
static unsigned short at, length;
static unsigned char serial, type;

static void every_number(void)
{
    int i;

    printf("%d", init_send_buffer(&at));
    printf(" %d", stuffchar(-5, request, &at));
    printf(" %d", stuff2byteint(-300, request, &at));
    printf(" %d", stuff4byteint(-70000L, request, &at));
    printf(" %d", stuffuchar(250, request, &at));
    printf(" %d", stuff2byteuint(65535, request, &at));
    printf(" %d", stuff4byteuint(4294967295UL, request, &at));
    printf(" %d", stuffdouble(-0.15625, request, &at));
    printf(" %d\n", stuff_send_buffer_header(at, 7, 99, request));
    for (i = 0; i < at; i++)
        printf("%02x", request[i]);
    printf("\n%d", extract_receive_buffer_header(&length, &serial, &type, request));
    printf(" %d %d %d", length, serial, type);
    printf(" %d", init_receive_buffer(&at));
    printf(" %d", extractchar(request, &at));
    printf(" %d", extract2byteint(request, &at));
    printf(" %ld", extract4byteint(request, &at));
    printf(" %d", extractuchar(request, &at));
    printf(" %d", extract2byteuint(request, &at));
    printf(" %lu", extract4byteuint(request, &at));
    printf(" %g", extractdouble(request, &at));
    printf(" %d\n", at);
}

static void no_room(void)
{
    at = USER_BUFFER_LENGTH - 7;
    printf("%d", stuffdouble(1.5, request, &at));
    printf(" %g", extractdouble(request, &at));
    printf(" %d", USER_BUFFER_LENGTH - at);
    at = USER_BUFFER_LENGTH;
    printf(" %d", stuffuchar(1, request, &at));
    printf(" %d", extractuchar(request, &at));
    printf(" %d %ld\n", USER_BUFFER_LENGTH - at, State[STATE_ERROR]);
}

int main(int argc, char **argv)
{
    long left = 0;

    if (argc != 2)
        return 2;
    every_number();
    no_room();
    SERV_TCP_PORT = atoi(argv[1]);
    if (!connect_robot(1L))
        return 1;

    init_send_buffer(&at);
    stuff2byteint(1, request, &at);
    stuff2byteint(0, request, &at);
    stuff4byteint(12345L, request, &at);
    stuff_send_buffer_header(at, 200, 41, request);
    printf("%d", special_request(request, reply));
    extract_receive_buffer_header(&length, &serial, &type, reply);
    init_receive_buffer(&at);
    printf(" %d %d %d", length, serial, type);
    printf(" %ld", extract4byteint(reply, &at));
    printf(" %ld", extract4byteint(reply, &at));
    printf(" %d\n", at);

    printf("%d", arm_zr(1));
    printf(" %d", arm_ws(1, 0, 12345L, &left));
    printf(" %ld %ld\n", left, State[STATE_ERROR]);
    return !disconnect_robot(1L);
}
