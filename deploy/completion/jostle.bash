# Completion of jostle(1) in bash. What there is to complete the programs say themselves, so that nothing here grows old.

_jostle() {
  local word=${COMP_WORDS[COMP_CWORD]} candidate
  COMPREPLY=()
  while IFS=$'\t' read -r candidate _; do
    if [ "$candidate" = :files ]; then
      compopt -o filenames 2>/dev/null
      mapfile -t -O "${#COMPREPLY[@]}" COMPREPLY < <(compgen -f -- "$word")
    elif [[ $candidate == "$word"* ]]; then
      [[ $candidate != *: ]] || compopt -o nospace 2>/dev/null
      COMPREPLY+=("$candidate")
    fi
  done < <("${COMP_WORDS[0]}" --complete "${COMP_WORDS[@]:1:COMP_CWORD}" 2>/dev/null)
}
complete -F _jostle jostle
