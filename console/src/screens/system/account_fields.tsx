import { useTranslation } from "react-i18next";
import { SelectField, TextField } from "../../controls/fields";
import { LONGEST_PASSWORD, NAME_PATTERN, SHORTEST_PASSWORD } from "./accounts";

/** The name of a new person or key. */
export function NameField({ value, change }: { value: string; change: (value: string) => void }) {
  const { t } = useTranslation();
  return (
    <TextField
      label={t("system.name")}
      value={value}
      onChange={(event) => change(event.target.value)}
      pattern={NAME_PATTERN}
      title={t("system.name_rule")}
      autoComplete="off"
      required
    />
  );
}

/** What a person or a key may do. */
export function RoleField({ roles, value, change }: {
  roles: readonly string[];
  value: string;
  change: (value: string) => void;
}) {
  const { t } = useTranslation();
  return (
    <SelectField label={t("system.role")} value={value} onChange={(event) => change(event.target.value)}>
      {roles.map((one) => (
        <option key={one} value={one}>
          {t(`role.${one}`)}
        </option>
      ))}
    </SelectField>
  );
}

/** A new password, which the browser does not fill in. */
export function PasswordField({ label, value, change, required = false }: {
  label: string;
  value: string;
  change: (value: string) => void;
  required?: boolean;
}) {
  return (
    <TextField
      label={label}
      type="password"
      value={value}
      onChange={(event) => change(event.target.value)}
      minLength={SHORTEST_PASSWORD}
      maxLength={LONGEST_PASSWORD}
      autoComplete="new-password"
      required={required}
    />
  );
}
