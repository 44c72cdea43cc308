// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_EXPOSURE
#define NACRE_EXPOSURE

// Bins of the histogram are eighths of a stop from 2^-16 to 2^16 cd/m2; bin 0 takes all that is darker.
const uint bin_count = 256u;
const float bins_per_stop = 8.0;
const float first_stop = -16.0;

float luminance(vec3 color) { return dot(color, vec3(0.2126, 0.7152, 0.0722)); }

#endif
