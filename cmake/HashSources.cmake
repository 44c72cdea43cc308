# SPDX-License-Identifier: Apache-2.0
# Writes a header with one number over the content of source files, for keys of caches that hold what the sources make.
# Run as: cmake -DOUTPUT=<header> -DNAME=<constant> -DINPUTS=<files> -P HashSources.cmake
set(all "")
foreach(input IN LISTS INPUTS)
  file(SHA256 "${input}" hash)
  string(APPEND all "${hash}")
endforeach()
string(SHA256 all "${all}")
string(SUBSTRING "${all}" 0 16 number)
file(WRITE "${OUTPUT}" "#pragma once\ninline constexpr unsigned long long ${NAME} = 0x${number}ull;\n")
