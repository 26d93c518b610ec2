import type { ReactNode } from "react";
import { useTranslation } from "react-i18next";
import type { RequestError } from "../api/client";
import { describeError } from "../i18n/describe_error";
import type { Resource } from "../live/use_resource";
import { Button } from "./Button";
import { Icon, type IconName } from "./Icon";
import { useWaitingText } from "./use_waiting_text";

/** A message in its place on the page; errors are announced at once. */
export function Notice({ kind, children }: { kind: "error" | "info" | "good"; children: ReactNode }) {
  return (
    <div className={`notice notice-${kind}`} role={kind === "error" ? "alert" : "status"}>
      <Icon name={kind === "good" ? "check" : "warning"} />
      <div>{children}</div>
    </div>
  );
}

/** An error in plain words, with a way to try again. */
export function ErrorNotice({ error, retry }: { error: RequestError; retry?: () => void }) {
  const { t } = useTranslation();
  return (
    <Notice kind="error">
      <p>{describeError(error, t)}</p>
      {retry && (
        <Button kind="plain" onClick={retry}>
          {t("action.try_again")}
        </Button>
      )}
    </Notice>
  );
}

/** A screen whose content is loaded, or cannot be. */
export function Unloaded({ title, error, retry, children }: {
  title: string;
  error: RequestError | null;
  retry: () => void;
  children?: ReactNode;
}) {
  return (
    <div className="screen">
      <h1 className="visually-hidden">{title}</h1>
      {error ? <ErrorNotice error={error} retry={retry} /> : <Skeleton />}
      {children}
    </div>
  );
}

/** What a list shows when it is empty: what would be there, and how it gets there.
 *
 * With `isScreen` there is nothing else on the screen: its title is that of the screen.
 */
export function Empty({ icon, title, text, isScreen = false, children }: {
  icon: IconName;
  title: string;
  text?: string;
  isScreen?: boolean;
  children?: ReactNode;
}) {
  const Title = isScreen ? "h1" : "h2";
  return (
    <div className="empty">
      <span className="empty-icon">
        <Icon name={icon} size={28} />
      </span>
      <Title>{title}</Title>
      {text !== undefined && <p>{text}</p>}
      {children}
    </div>
  );
}

/** Grey lines in the shape of a list that loads; after some seconds they say what they wait for. */
export function Skeleton({ rows = 4 }: { rows?: number }) {
  const text = useWaitingText();
  return (
    <div className="skeleton" role="status">
      <p className={text.isLong ? "muted" : "visually-hidden"}>{text.text}</p>
      {Array.from({ length: rows }, (_, index) => (
        <span key={index} />
      ))}
    </div>
  );
}

/** A loaded list, or its state: loading, an error, or nothing there. */
export function Loaded<Row>({ resource, empty, missing, children }: {
  resource: Resource<Row[]>;
  empty: ReactNode;
  /** What to show where this edge server does not have the resource. */
  missing?: ReactNode;
  children: (rows: Row[]) => ReactNode;
}) {
  const { value, error, isLoading, reload } = resource;
  if (error?.status === 404 && missing !== undefined) return <>{missing}</>;
  if (value === null) {
    if (error) return <ErrorNotice error={error} retry={reload} />;
    return isLoading ? <Skeleton /> : null;
  }
  return (
    <>
      {error && <ErrorNotice error={error} retry={reload} />}
      {value.length === 0 ? empty : children(value)}
    </>
  );
}

/** What is wrong with a file, by its place in it. */
export function FaultList({ faults, nameOf }: {
  faults: readonly { path: string; text: string }[];
  /** Gives a person's name of a path, or null to show the path. */
  nameOf?: (path: string) => string | null;
}) {
  return (
    <ul className="small">
      {faults.map((fault) => (
        <li key={fault.path + fault.text}>
          {nameOf?.(fault.path) ?? <code>{fault.path}</code>} {fault.text}
        </li>
      ))}
    </ul>
  );
}
