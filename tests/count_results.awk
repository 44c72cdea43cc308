# SPDX-License-Identifier: Apache-2.0
# Reads CTest's LastTest.log and prints "N passed, N failed, N skipped", counted in GoogleTest cases. A test program
# that is not of GoogleTest counts as one case, and so does one that broke down without naming a failed case.
# Ends with 1 where something failed or nothing ran.

function finish() {
    if (!in_test) return
    if (!cases_seen) {
        if (verdict == "passed") passed += 1
        else if (verdict == "skipped") skipped += 1
    }
    if (verdict == "failed" && !failures_seen) failed += 1
    in_test = 0
}

/^[0-9]+\/[0-9]+ Testing: / {
    finish()
    in_test = 1
    cases_seen = 0
    failures_seen = 0
    verdict = "failed"
}
/^\[  PASSED  \] [0-9]+ tests?\.$/ { passed += $4; cases_seen = 1 }
/^\[  SKIPPED \] [0-9]+ tests?, listed below:$/ { skipped += $4 }
/^\[  FAILED  \] [0-9]+ tests?, listed below:$/ { failed += $4; failures_seen = 1 }
/^Test Passed\.$/ { verdict = "passed" }
/^Test Skipped\.$/ { verdict = "skipped" }

END {
    finish()
    printf "%d passed, %d failed, %d skipped\n", passed, failed, skipped
    exit failed > 0 || passed == 0
}
