/** Prints "name fingerprint" of each class named, as lcmtypes/fingerprints.txt has them. */
public final class Fingerprints {
    public static void main(String[] names) throws ReflectiveOperationException {
        for (String name : names) {
            long fingerprint = Class.forName("abs_hil." + name).getField("LCM_FINGERPRINT").getLong(null);
            System.out.printf("%s %016x%n", name, fingerprint);
        }
    }
}
