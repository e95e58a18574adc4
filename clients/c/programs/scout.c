/* scout.c: see scout.h. */
#define _XOPEN_SOURCE 600

#include "scout.h"

#include "../Nclient.h"
#include "datagrams.h"

#include <limits.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#define NEAR 15  /* inches: go slowly and turn away */
#define CLOSE 8  /* inches: do not go on at all */
#define CRUISE 75 /* 1/10 inch a second */
#define CREEP 15
#define TURN_AWAY 320 /* 1/10 degree a second */
#define TURN_IN_PLACE 340

/* The sonars that look forwards or to a side, from the right to the left. */
static const int front[] = {12, 13, 14, 15, 0, 1, 2, 3, 4};

static volatile sig_atomic_t interrupted;

static void interrupt(int number)
{
    (void) number;
    interrupted = 1;
}

void read_options(int argc, char **argv, const char *allowed, struct scout *scout)
{
    int option, right = 1;

    while ((option = getopt(argc, argv, allowed)) != -1) {
        switch (option) {
        case 'h':
            scout->host = optarg;
            break;
        case 'p':
            right &= read_whole(optarg, 1, 65535, &scout->port);
            break;
        case 'r':
            right &= read_whole(optarg, 1, INT_MAX, &scout->robot);
            break;
        case 'f':
            right &= read_whole(optarg, 0, 255, &scout->rate);
            break;
        case 'w':
            right &= read_whole(optarg, 0, 1000, &scout->pause);
            break;
        case 'n':
            right &= read_whole(optarg, 0, INT_MAX, &scout->loops);
            break;
        case 'd':
            right &= read_whole(optarg, 1, 65535, &scout->datagrams);
            break;
        case 'l':
            scout->listen = optarg;
            break;
        case 'q':
            scout->leave = 1;
            break;
        default:
            right = 0;
        }
    }
    if (right && optind == argc)
        return;
    fprintf(stderr, "usage: %s [-h HOST] [-p PORT] [-r ROBOT] [-f RATE] [-w MILLISECONDS] [-n LOOPS]%s\n", argv[0],
            scout->datagrams != 0 ? " [-d DATAGRAM_PORT] [-l ADDRESS] [-q]" : "");
    exit(2);
}

int begin_scout(const struct scout *scout)
{
    struct sigaction action;
    int order[SONARS], i;

    action.sa_handler = interrupt;
    action.sa_flags = 0;
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);

    SERV_TCP_PORT = scout->port;
    if (!set_server_machine_name(scout->host)) {
        fprintf(stderr, "The name of the server's machine is too long.\n");
        return 0;
    }
    if (!connect_robot((long) scout->robot)) {
        if (State[STATE_ERROR] != NCLIENT_NO_CONNECTION)
            fprintf(stderr, "The server has no robot %d for us.\n", scout->robot);
        return 0;
    }
    for (i = 0; i < SONARS; i++)
        order[i] = i;
    return conf_tm(1) && conf_sn(scout->rate, order);
}

int goes_on(const struct scout *scout)
{
    static int done = 0;

    if (interrupted || (scout->loops > 0 && done == scout->loops))
        return 0;
    done += scout->loops > 0;
    return 1;
}

int end_scout(const struct scout *scout)
{
    if (st() && disconnect_robot((long) scout->robot))
        return 0;
    fprintf(stderr, "Robot %d no longer answers: error %ld.\n", scout->robot, State[STATE_ERROR]);
    return 1;
}

long nearest_front(void)
{
    long nearest = State[STATE_SONAR_0];
    size_t i;

    for (i = 0; i < sizeof front / sizeof front[0]; i++)
        if (State[STATE_SONAR_0 + front[i]] < nearest)
            nearest = State[STATE_SONAR_0 + front[i]];
    return nearest;
}

/* It always turns to the left: one that chose the freer side each time would tremble in a corner for ever. */
int wander(void)
{
    long inches = nearest_front();

    if (inches < CLOSE)
        return scout_vm(0, TURN_IN_PLACE);
    return inches < NEAR ? scout_vm(CREEP, TURN_AWAY) : scout_vm(CRUISE, 0);
}
