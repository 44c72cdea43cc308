# SPDX-License-Identifier: Apache-2.0
# Tab completion of the command `nacre` for bash. Try it with: source <(nacre completion)
# The candidates come from the command itself, so they always fit the version that is installed.

_nacre() {
    local IFS=$'\n' current candidates
    # Bash splits words at ':' and '='; backends are written with colons, so words are taken from the line instead.
    local line=${COMP_LINE:0:COMP_POINT} words
    IFS=$' \t\n' read -r -a words <<<"$line"
    [[ $line == *[[:space:]] ]] && words+=("")
    current=${words[-1]}
    candidates=$("${words[0]}" completion --list -- "${words[@]:1}" 2>/dev/null) || return 0

    COMPREPLY=()
    case $candidates in
        '<file>') compopt -o filenames 2>/dev/null; COMPREPLY=($(compgen -f -- "$current")); return ;;
        '<folder>') compopt -o filenames 2>/dev/null; COMPREPLY=($(compgen -d -- "$current")); return ;;
        *'<file>'*)
            compopt -o filenames 2>/dev/null
            COMPREPLY=($(compgen -f -- "$current"))
            candidates=${candidates//'<file>'/}
            ;;
    esac
    COMPREPLY+=($(compgen -W "$candidates" -- "$current"))
    # What stands before the last colon is already on the line for bash.
    if [[ $current == *:* && $COMP_WORDBREAKS == *:* ]]; then
        local prefix=${current%:*}:
        COMPREPLY=("${COMPREPLY[@]#"$prefix"}")
    fi
}
complete -F _nacre nacre
