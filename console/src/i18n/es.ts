/** Spanish, in one part that is loaded where it is chosen. */

import faults from "./faults.es.json";
import reports from "./reports.es.json";
import texts from "./es.json";

export default { texts, phrases: { ...reports, ...faults } };
