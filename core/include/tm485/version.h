/* The version of the stack, by Semantic Versioning, for C and C++. The build files read the three numbers from here,
   so this is the only place that states them. */
#pragma once

#define TM485_VERSION_MAJOR 0
#define TM485_VERSION_MINOR 1
#define TM485_VERSION_PATCH 0

#define TM485_VERSION_QUOTED(x) #x
#define TM485_VERSION_TEXT(x) TM485_VERSION_QUOTED(x)

/* "MAJOR.MINOR.PATCH" of the headers that a program was compiled with. */
#define TM485_VERSION_STRING              \
  TM485_VERSION_TEXT(TM485_VERSION_MAJOR) \
  "." TM485_VERSION_TEXT(TM485_VERSION_MINOR) "." TM485_VERSION_TEXT(TM485_VERSION_PATCH)
