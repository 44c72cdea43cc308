// SPDX-License-Identifier: Apache-2.0
// A program only so that its compiler flags are those of the tests, which share its precompiled header.
int main() { return 0; }
