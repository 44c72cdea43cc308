// SPDX-License-Identifier: Apache-2.0
// Nothing: the library exists for its precompiled header.
