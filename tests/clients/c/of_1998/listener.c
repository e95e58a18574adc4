/* An array for each thing that is sensed, filled after every call, and places of readings with them. */
#include <stdio.h>
#include "Nclient.h"

int SonarRange[16];
long X, Y, Heading, Bumped;
PosData seen[SONARS];

GetSensorData()
{
  int i;

  for (i = 0; i < 16; i++)
    SonarRange[i] = State[STATE_SONAR_0 + i];
  X = State[STATE_CONF_X];
  Y = State[STATE_CONF_Y];
  Heading = State[STATE_CONF_STEER];
  Bumped = State[STATE_BUMPER];
}

main(argc, argv)
int argc;
char *argv[];
{
  int i, order[16], mask[NUM_MASK];

  strncpy(SERVER_MACHINE_NAME, "localhost", sizeof(SERVER_MACHINE_NAME));
  SERV_TCP_PORT = atoi(argv[1]);
  connect_robot(1);
  place_robot(0, 0, 0, 0);
  for (i = 0; i < 16; i++)
    order[i] = (5 * i) % 16;
  order[15] = -1;
  conf_sn(1, order);
  init_sensors();
  get_mask(mask);
  posDataRequest(POS_SONAR | POS_BUMPER);
  printf("attached %d mask %d %d\n", posDataCheck(), mask[SMASK_SONAR_1], mask[SMASK_POS_DATA]);
  vm(RIGHT(100, 0), LEFT(100, 0), 0);
  for (i = 0; i < 60; i++) {
    gs();
    GetSensorData();
  }
  st();
  get_sn();
  get_rv();
  GetSensorData();
  posSonarRingGet(seen);
  printf("front %d back %d bumped %ld error %ld\n", SonarRange[0], SonarRange[8], Bumped, State[STATE_ERROR]);
  printf("read at %d\n", seen[0].config.configX > 0 && seen[0].config.configX <= X
                         && seen[0].timeStamp <= (unsigned long) posTimeGet());
  printf("volts %d\n", voltCpuGet() > 4.7 && voltMotorGet() > 4.7);
  disconnect_robot(1);
}
