/* What is left of a program whose server goes away in the midst of things; a line of input says when it has. */
#include "Nclient.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void say(int answer)
{
    printf("%d %ld %ld\n", answer, State[STATE_ERROR], State[STATE_CONF_X]);
}

int main(int argc, char **argv)
{
    static char text[1000000];

    if (argc != 3)
        return 2;
    SERV_TCP_PORT = atoi(argv[1]);
    strcpy(SERVER_MACHINE_NAME, argv[2]);
    say(gs());
    say(connect_robot(1L));
    if (fgets(text, sizeof text, stdin) == NULL)
        return 2;
    memset(text, 'a', sizeof text - 1);
    say(tk(text));
    say(vm(10, 10, 0));
    say(connect_robot(1L));
    say(gs());
    say(connect_robot(1L));
    say(gs());
    say(disconnect_robot(1L));
    if (fgets(text, sizeof text, stdin) != NULL)
        printf("%s", text);
    return 0;
}
