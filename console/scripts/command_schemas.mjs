// Extracts the parameters of the eleven commands from the OpenAPI document, so that the forms have
// the server's own ranges and defaults without the rest of the document in the browser.
import { readFileSync, writeFileSync } from "node:fs";

const document = JSON.parse(readFileSync("generated/openapi.json", "utf8"));
const schemas = document.components.schemas;
const resolved = (schema) =>
  schema.$ref ? { ...resolved(schemas[schema.$ref.split("/").pop()]), ...rest(schema) } : schema;
const rest = ({ $ref: _reference, ...others }) => others;

function parameter(name, schema, required) {
  const outer = resolved(schema);
  const choices = (outer.anyOf ?? [outer]).map(resolved);
  const value = choices.find((choice) => choice.type !== "null") ?? outer;
  const single = value.allOf ? { ...value, ...resolved(value.allOf[0]) } : value;
  return {
    name,
    type: single.type ?? "number",
    minimum: single.minimum ?? single.exclusiveMinimum ?? null,
    maximum: single.maximum ?? single.exclusiveMaximum ?? null,
    above_minimum: single.exclusiveMinimum !== undefined,
    below_maximum: single.exclusiveMaximum !== undefined,
    choices: single.enum ?? null,
    default: outer.default ?? null,
    nullable: choices.some((choice) => choice.type === "null"),
    required,
  };
}

const commands = [];
for (const schema of Object.values(schemas)) {
  const type = schema.properties?.command_type_id;
  const number = type && (type.const ?? type.enum?.[0]);
  if (!number || !schema.properties.parameters?.$ref) continue;
  const parameters = resolved(schema.properties.parameters);
  const required = parameters.required ?? [];
  commands.push({
    command_type_id: number,
    parameters: Object.entries(parameters.properties ?? {}).map(([name, one]) =>
      parameter(name, one, required.includes(name)),
    ),
  });
}
commands.sort((one, other) => one.command_type_id - other.command_type_id);
if (commands.length !== 11) throw new Error(`the document has ${commands.length} commands, not 11`);
writeFileSync("generated/commands.json", `${JSON.stringify(commands, null, 1)}\n`);
