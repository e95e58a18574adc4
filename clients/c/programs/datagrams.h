/*
 * Three numbers as text in a datagram: 128 bytes, of which the first 38 are three fields of width 12 with two decimals
 * and a space between them, and the rest zeros.
 */
#ifndef DATAGRAMS_H
#define DATAGRAMS_H

#define DATAGRAM 128
#define NUMBERS 3
#define LEAST_NUMBER -99999999.99 /* what still fits into its field */
#define GREATEST_NUMBER 999999999.99

#define THIS_MACHINE "127.0.0.1"
#define ROB1_PORT 5001
#define ROB2_PORT 5002
#define READER_PORT 4000

/* Each of these says on standard error what went wrong. */

int listen_at(const char *address, int port);                       /* a socket that hears them, -1 for none */
int hear(int listening, double numbers[NUMBERS]);                   /* whether one waited that holds three numbers */
int send_to(const char *host, int port, double numbers[NUMBERS]);   /* whether it is on its way */
int read_numbers(char **words, double numbers[NUMBERS]);            /* whether the three words are numbers that fit */
int read_whole(const char *word, int least, int most, int *number); /* whether it is one from least to most */

#endif
