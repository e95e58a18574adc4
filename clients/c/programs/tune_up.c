/*
 * tune_up.c: a Scout goes about and touches nothing.
 *
 * The program of 1998 that this one follows was printed with a mistake. It looked for things nearer than 10 in an array
 * of ranges that it never filled, found one every time, and turned on the spot for ever. Here the sonars decide.
 */
#define _XOPEN_SOURCE 600

#include "../Nclient.h"
#include "scout.h"

#include <poll.h>
#include <stdio.h>

/* Be at home by its encoders, and where it was by the world. */
static int come_home(void)
{
    int x = (int) State[STATE_CONF_X], y = (int) State[STATE_CONF_Y];

    return zr() && ws(1, 1, 1, 20) && place_robot(x, y, 0, 0);
}

static int back_off(void)
{
    return st() && tk("Ouch.") && scout_pr(-60, 0) && ws(1, 1, 0, 5) && scout_pr(0, 900) && ws(1, 1, 0, 5);
}

int main(int argc, char **argv)
{
    struct scout scout = {"", 7019, 1, 1, 20, 0, 0, "", 0};
    int touched = 0;

    read_options(argc, argv, "h:p:r:f:w:n:", &scout);
    if (!begin_scout(&scout) || !come_home())
        return 1;
    while (goes_on(&scout)) {
        if (!wander())
            break;
        if (State[STATE_BUMPER] != 0) {
            touched++;
            if (!back_off())
                break;
        }
        poll(NULL, 0, scout.pause);
    }
    printf("robot %d is at %ld, %ld; it touched something %d times\n", scout.robot, State[STATE_CONF_X],
           State[STATE_CONF_Y], touched);
    return end_scout(&scout);
}
