/* Without any header: every call unannounced, every number an int. */
extern long State[];
extern int Smask[];
extern int SERV_TCP_PORT;

long wall[9];
int order[4];
double hit[3];

main(argc, argv)
char **argv;
{
  int i;
  long conf[4];

  SERV_TCP_PORT = atoi(argv[1]);
  set_server_machine_name("127.0.0.1");
  printf("connected %d\n", connect_robot(1) != 0);
  printf("again %d\n", server_is_running() != 0);
  place_robot(-200, -100, -900, 0);
  gs();
  printf("at %ld %ld %ld\n", State[34], State[35], State[36]);
  dp(-7, -8);
  da(450, 450);
  get_rc();
  printf("told %ld %ld %ld\n", State[34], State[35], State[36]);
  order[0] = 0; order[1] = 8; order[2] = 255;
  printf("sonars %d\n", conf_sn(0, order));

  wall[0] = 4;
  wall[1] = 200; wall[2] = -900; wall[3] = 260; wall[4] = -900;
  wall[5] = 260; wall[6] = 900; wall[7] = 200; wall[8] = 900;
  printf("wall %d\n", add_obstacle(wall));
  printf("moved %d", move_Obs(wall, -60, 10));
  for (i = 0; i < 9; i++) printf(" %ld", wall[i]);
  printf("\nblocked %d", motion_check(0, -200.0, 0.0, 300.0, 0.0, 0.0, 0.0, 0.0, hit));
  printf(" at %.0f %.0f %.2f\n", hit[0], hit[1], hit[2]);
  printf("gone %d\n", delete_Obs(wall));
  printf("free %d\n", motion_check(0, -200.0, 0.0, 300.0, 0.0, 0.0, 0.0, 0.0, hit));
  printf("drawn %d\n", draw_line(-100, -100, 100, 100, 3) + draw_arc(-50, 50, 100, 100, 0, 3600, 2));
  printf("conf %d\n", get_robot_conf(conf));

  printf("bumper %d compass %d\n", get_bp(), get_cp());
  vm(-40, 40, 0);
  for (i = 0; i < 30; i++) gs();
  printf("turning %ld %ld\n", State[38], State[39]);
  printf("other %d %ld\n", connect_robot(99) != 0, State[44]);
  disconnect_robot(1);
  exit(0);
}
