#!/usr/bin/env bash
# Writes what the code says into the tables of the documents: tests/docs/refresh.sh BUILD_FOLDER
# (after a change of a table in core; the tests docs/* fail until it is done).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
tables="${1:?build folder}/tests/docs/tm485_doc_tables"

replace() { # DOCUMENT BLOCK
  local new
  new=$(mktemp)
  "$tables" "$2" >"$new"
  sed -i -e "/^<!-- block: $2 -->\$/,/^<!-- end: $2 -->\$/{/^<!-- block: /{p;r $new
};/^<!-- end: /p;d}" "$1"
  rm -f "$new"
}
for block in errors status; do replace docs/errors.md "$block"; done
for block in exchanges timing presets alarms; do replace docs/protocol.md "$block"; done
replace docs/doctor.md findings
for block in usb_chips uart_drivers; do replace docs/linux.md "$block"; done
replace docs/fault-plans.md faults
