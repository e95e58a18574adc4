/* As students wrote it: round a square and home, saying what it does. */
#include "Nclient.h"
#include <stdio.h>
#include <string.h>

#define SIDE 240

report(where)
char *where;
{
  printf("%s: x %ld y %ld heading %ld\n", where,
         State[STATE_CONF_X], State[STATE_CONF_Y], State[STATE_CONF_STEER]);
}

main(argc, argv)
int argc;
char **argv;
{
  int i, order[16];

  strcpy(SERVER_MACHINE_NAME, "127.0.0.1");
  SERV_TCP_PORT = atoi(argv[1]);
  if (!connect_robot(1, MODEL_SCOUT, "/dev/ttyS0", 38400)) {
    printf("no robot\n");
    exit(1);
  }
  init_mask();
  conf_tm(5);
  for (i = 0; i < 16; i++) order[i] = i;
  conf_sn(15, order);
  sp(200, 200, 0);
  zr();
  ws(1, 1, 1, 20);
  report("home");
  for (i = 0; i < 4; i++) {
    scout_pr(SIDE, 0);
    ws(1, 1, 0, 20);
    report("corner");
    scout_pr(0, 900);
    ws(1, 1, 0, 20);
  }
  report("home");
  tk("Done.");
  disconnect_robot(1);
  exit(0);
}
